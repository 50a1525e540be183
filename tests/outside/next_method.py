"""A second method, as docs/next_method.md tells it: cells split by support vector machines."""

from dataclasses import dataclass

import numpy as np
from sklearn.cluster import KMeans
from sklearn.svm import LinearSVC

import vsp


@dataclass(frozen=True)
class SvmSplits:
    """Split the cell with the largest error between two clusters of states and actions, until there are `n_cells`."""

    n_cells: int

    def __call__(self, agent, task, data, seed):
        rows = np.random.default_rng(seed).permutation(len(data.states))[:20_000]
        states, actions, scale = data.states[rows], data.actions[rows], data.states.std(axis=0)
        inputs = np.column_stack([states, np.ones(len(states))])
        joint = np.column_stack([states / scale, actions / task.action_high])
        leaves, normals, thresholds, children = [(None, rows < np.inf)], [], [], []  # where a leaf hangs, its states
        while True:
            maps = [np.linalg.lstsq(inputs[inside], actions[inside], rcond=None)[0] for _, inside in leaves]
            errors = [np.square(inputs[i] @ fit - actions[i]).sum() for fit, (_, i) in zip(maps, leaves)]
            if len(leaves) == self.n_cells:
                break
            hangs, inside = leaves.pop(int(np.argmax(errors)))
            side = KMeans(2, n_init=3, random_state=seed).fit_predict(joint[inside])
            svm = LinearSVC(random_state=seed, class_weight="balanced").fit(states[inside] / scale, side)
            normals.append(svm.coef_[0] / scale)
            thresholds.append(-svm.intercept_[0])
            children.append([0, 0])
            if hangs:
                children[hangs[0]][hangs[1]] = len(children) - 1
            beyond = states @ normals[-1] > thresholds[-1]
            leaves += [((len(children) - 1, side), inside & (beyond == side)) for side in (0, 1)]
        for cell, (hangs, _) in enumerate(leaves):
            children[hangs[0]][hangs[1]] = -1 - cell
        return vsp.PiecewisePolicy(vsp.Halfspaces(normals, thresholds, children), maps, task=task)


def methods(n_cells):
    """The paper's method, and the new one, which gets 400 episodes of the agent."""
    return {"paper": vsp.paper_method(), "SVM": vsp.Method(SvmSplits(n_cells), n_data=400)}
