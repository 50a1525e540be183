"""Another local model: sines of the inputs."""

import numpy as np

import vsp


def sines(task):
    terms, code = (pattern.format for pattern in ("sin({})", "sin(state[{}])"))
    names, codes = map(terms, task.inputs), map(code, range(len(task.inputs)))
    return vsp.PolicyClass("sines", (*names,), (*codes,), np.ones(len(task.inputs)), np.sin)
