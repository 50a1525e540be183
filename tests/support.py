"""What several test files share: teachers that need no file, a short configuration, small partitions, processes."""

import ctypes
import dataclasses
import functools
import hashlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from vsp import Config, Partition, VoronoiPolicy, geometry, get_task
from vsp.rollouts import Episode
from vsp.run import ROOT
from vsp.subpolicies import policy_class
from vsp.teachers import Teacher


def nearest_from(least, codewords, states, metric):
    """`vsp.nearest` with the kd-tree for `least` codewords or more."""
    with mock.patch.object(geometry, "KDTREE_FROM", least):
        return geometry.nearest(codewords, states, metric)


nearest_brute, nearest_kdtree = (functools.partial(nearest_from, least) for least in (np.inf, 2))

QUICK = "VSP_FULL" not in os.environ  # whether notebooks run quickly
SIMPLEGOAL, MOUNTAINCAR = "SimpleGoal-v0", "MountainCarContinuous-v0"
PENDULUM, LUNARLANDER = "Pendulum-v1", "LunarLanderContinuous-v3"
WALKER, CHEETAH = "BipedalWalker-v3", "HalfCheetah-v5"
TASKS = (SIMPLEGOAL, MOUNTAINCAR)  # of the paper

TINY = Config(
    n_epochs=120, n_split=4, n_merge=10, n_freeze=30, n_reset=25,
    min_param_distance=0.6, min_pol_distance=0.2, max_pol_loss=0.02, batch_size=8, learning_rate=0.01,
)  # fmt: skip


def softsign(x):
    """Like tanh, but of additions and divisions alone: the same number on every machine and in every batch."""
    return x / (1 + np.abs(x))


class CurvedTeacher:
    """Goes to the goal of SimpleGoal along a curve; row by row, so the batch has no say in the numbers."""

    digest = hashlib.sha256(b"curved").hexdigest()

    def predict(self, obs):
        x, y = np.asarray(obs, dtype=np.float64).T
        return np.stack([softsign(3 * y * y - 4 * x), softsign(x * y - 5 * y + 2 * y * x * x)], axis=-1), None


class PumpingTeacher:
    """Pushes MountainCar the way it moves."""

    digest = hashlib.sha256(b"pumping").hexdigest()

    def predict(self, obs):
        return softsign(60 * np.asarray(obs, dtype=np.float64)[..., 1:]), None


TEACHERS = {SIMPLEGOAL: CurvedTeacher(), MOUNTAINCAR: PumpingTeacher()}


class RandomPolicy:
    """Uniform actions, also beyond the limits."""

    def __init__(self, m, *, seed=0, bound=1.5):
        self.m, self.bound, self.rng = m, bound, np.random.default_rng(seed)

    def predict(self, obs):
        return self.rng.uniform(-self.bound, self.bound, size=(len(obs), self.m)).astype(np.float32), None


class Constant:
    """The same action everywhere."""

    def __init__(self, *action):
        self.action = np.array(action)

    def predict(self, obs):
        return np.tile(self.action, (len(obs), 1)), None


def network_teacher(task, *, seed=0, width=(40, 30)):
    """A `Teacher` with random weights."""
    rng, task = np.random.default_rng(seed), get_task(task)
    sizes, weights = [len(task.low), *width, len(task.action_low)], {}
    for i, (rows, columns) in enumerate(zip(sizes, sizes[1:])):
        weights[f"mu.{2 * i}.weight"] = rng.normal(size=(columns, rows)).astype(np.float32) / np.float32(rows**0.5)
        weights[f"mu.{2 * i}.bias"] = rng.normal(size=columns).astype(np.float32)
    return Teacher(weights, task)


def random_policy(k=6, *, seed=0, task=SIMPLEGOAL, form="linear", scaled=False, **options):
    """Of codewords in the box and maps that reach the limits; `scaled`: of states that are divided, each by a number
    of its own."""
    rng, task = np.random.default_rng(seed), get_task(task)
    units = policy_class(form, task).units
    codewords = rng.uniform(task.low, task.high, size=(k, len(task.low)))
    coefficients = rng.normal(size=(k, len(units), len(task.action_low))) / units
    if scaled:
        options["scale"] = np.linspace(0.5, 2, len(task.low))
    return VoronoiPolicy(codewords, coefficients, task=task, sub_policy=form, **options)


def tiny(**changes):
    return dataclasses.replace(TINY, **changes)


def slopes(function, vector):
    """The derivatives of `function` by each number of `vector`, from finite differences."""
    return np.array([function(vector + step) - function(vector - step) for step in 1e-6 * np.eye(len(vector))]) / 2e-6


def partition_of(codewords, biases=None, *, config=TINY, task=SIMPLEGOAL):
    """A partition with these codewords; each cell's map has zero weights, its bias for every action, and one sample."""
    partition = Partition(get_task(task), config)
    for codeword in np.asarray(codewords, dtype=np.float64):
        partition.add(codeword, np.random.default_rng(0))
    partition.models.coefficients[:] = 0.0
    if biases is not None:
        partition.models.coefficients[:, -1, :] = np.asarray(biases, dtype=np.float64)[:, None]
    m = len(partition.task.action_low)
    partition.observe(Episode(partition.codewords.copy(), np.zeros((len(codewords), m))))
    return partition


def walk(states, actions):
    """An episode with the same number for every action of a state."""
    states = np.asarray(states, dtype=np.float64)
    return Episode(states, np.repeat(np.asarray(actions, dtype=np.float64)[:, None], 2, axis=1))


def same_arrays(*pairs):
    return all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)


def examples(task, n=300, seed=0):
    """States of the whole box and actions that are linear but for some noise, (n, d) and (n, m)."""
    rng, task = np.random.default_rng(seed), get_task(task)
    states = rng.uniform(task.low, task.high, (n, 2))
    maps = rng.normal(size=(2, len(task.action_low)))
    return states, states @ maps + 0.3 + 0.1 * rng.normal(size=(n, len(task.action_low)))


def python(code, *arguments, cwd=ROOT, **options):
    """What `code` prints in a fresh Python, where it must not fail."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def called(main, *arguments):
    """What `main` returns for these arguments of its command line."""
    with mock.patch.object(sys, "argv", ["command", *map(str, arguments)]):
        return main()


_DISTIL = """
import dataclasses, hashlib, sys
import support, vsp
task, teacher, config, seed, ahead = sys.argv[1:]
vsp.algorithms.EPISODES_AHEAD = int(ahead)
players = {"curved": support.CurvedTeacher, "pumping": support.PumpingTeacher}
player = players[teacher]() if teacher in players else vsp.load_teacher(task)
policy, _ = vsp.distill(player, task, support.TINY if config == "tiny" else vsp.preset(task), seed=int(seed))
print(hashlib.sha256(policy.codewords.tobytes() + policy.coefficients.tobytes()).hexdigest())
"""


def distilled_elsewhere(task, *, teacher="shipped", config="paper", seed=0, ahead=500, **environment):
    """SHA-256 of the codewords and coefficients that a fresh Python distils with these environment variables."""
    environment = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])} | environment
    return python(_DISTIL, task, teacher, config, seed, ahead, env=os.environ | environment).strip()


def threads(n):
    """The environment variables for n threads of everything that has any."""
    return {f"{name}_NUM_THREADS": str(n) for name in ("OMP", "OPENBLAS", "MKL", "VECLIB", "NUMEXPR")}


def alive(pid: int) -> bool:
    """Whether there is a process of that number."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def until(condition) -> None:
    """Wait for `condition`, for at most two minutes."""
    deadline = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < deadline, "waited two minutes in vain"
        time.sleep(0.05)


STORY_PARAMETERS = 'out = ".."\nruns = "../data/runs"\nquick = False'


def write_story(folder: Path, *cells: str) -> Path:
    """story.ipynb, a notebook of code cells; a cell that begins with `# skip` never runs."""
    from vsp.run.notebook import nbformat  # which takes long, and few tests write notebooks

    notebook = nbformat.v4.new_notebook()
    notebook.metadata.kernelspec = {"name": "python3", "display_name": "Python 3", "language": "python"}
    for number, source in enumerate((STORY_PARAMETERS, *cells)):
        notebook.cells.append(nbformat.v4.new_code_cell(source, id=f"cell-{number}"))
        notebook.cells[-1].metadata.tags = ["skip-execution"] if source.startswith("# skip") else []
    notebook.cells[0].metadata.tags = ["parameters"]
    path = folder / "story.ipynb"
    nbformat.write(notebook, path)
    return path


def visible(folder):
    """The names in a folder."""
    return sorted(path.name for path in folder.iterdir())


def flipped(content, bit):
    """A copy of `content` in which that bit is the other one."""
    damaged = bytearray(content)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def compiled(policy, folder):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: `cc` is not there")
    (folder / "policy.c").write_text(policy.to_c(), encoding="utf-8")
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    library = folder / "policy.so"
    subprocess.run(["cc", *flags, "-o", library, folder / "policy.c", "-lm"], check=True, capture_output=True)
    return ctypes.CDLL(str(library))


def acted(library, state, m):
    """The cell and the action (m,) that the C code gives for a state."""
    state, action = (ctypes.c_double * len(state))(*state), (ctypes.c_double * m)(*[np.nan] * m)
    library.vsp_act(state, action)
    return library.vsp_cell(state), list(action)
