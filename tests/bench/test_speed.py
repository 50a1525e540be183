"""How fast it is, side by side with the direct way: `make bench`."""

import dataclasses
import shutil
import subprocess
import time
import tracemalloc
from functools import partial

import gymnasium
import numpy as np
import pytest
import torch
from direct import OneByOne, evaluate_directly, same_run, teacher_agent
from direct import distill as distill_directly

import vsp
from vsp.evaluate import outcomes

REPEATS = 5
SLOW_EPISODES = 100  # of the slow side of an evaluation; its time is scaled to 1000
MEMORY = 64  # bytes that an iteration more may take; the history's two numbers are 40


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


def seconds(work) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def race(quick, slow, *, calls=(1, 1), repeats: int = REPEATS) -> np.ndarray:
    """Seconds per call of both, in turn, after a call of each that does not count. (repeats, 2)"""
    quick(), slow()
    sides = list(zip((quick, slow), calls))
    return np.array([
        [seconds(lambda: [work() for _ in range(n)]) / n for work, n in sides] for _ in range(repeats)
    ])  # fmt: skip


def told(times: np.ndarray, least: float) -> tuple[str, bool]:
    """The median ratio of `times` (n, 2) and its range in words, and whether it is at least `least`."""
    ratios = times[:, 1] / times[:, 0]
    ours, direct = (duration(t) for t in np.median(times, axis=0))
    text = f"{np.median(ratios):.0f} times ({ratios.min():.0f} to {ratios.max():.0f}): {ours} against {direct}"
    return text, bool(np.median(ratios) >= least)


def duration(t: float) -> str:
    unit, name = next((u, name) for u, name in ((1, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")) if t >= u)
    return f"{t / unit:.3g} {name}"


@pytest.mark.parametrize("task", vsp.paper.TASKS)
def test_one_distillation(task, record, monkeypatch):
    """At the paper's configuration; every pair of runs is compared as well."""
    teacher, agent, config = vsp.load_teacher(task), teacher_agent(task), vsp.preset(task)
    vsp.distill(teacher, task, config, seed=0)
    times, same = [], True
    for seed in range(REPEATS):
        found = []
        slow = seconds(lambda: found.append(distill_directly(agent, gymnasium.make(task), config, seed=seed)))
        times.append((seconds(lambda: vsp.distill(teacher, task, config, seed=seed)), slow))
        same &= same_run(found[0], teacher, task, config, seed, monkeypatch)
    to_hold = f"{REPEATS} of {REPEATS} equal to the direct way, coefficients within 1e-9"
    record("speed", f"the same partition, {task}", to_hold, "all equal" if same else "not all equal", same)
    text, held = told(np.array(times), 40)
    record("speed", f"a distillation against the direct way, {task}", "40 times", text, held)


@pytest.mark.parametrize("task", vsp.paper.TASKS)
def test_evaluation_of_a_copy(task, record):
    policy = vsp.distill(vsp.load_teacher(task), task, seed=0)[0]
    text, held = told(evaluations(policy, policy, task), 100)
    record(
        "speed",
        f"1000 episodes of a copy against evaluate_policy ({SLOW_EPISODES}, scaled), {task}",
        "100 times",
        text,
        held,
    )
    gap = np.abs(evaluate_directly(policy, task, 1000, seed=1) - outcomes(policy, task, 1000, seed=1).returns).max()
    text = f"largest difference {gap:.1g}"
    record("speed", f"the same 1000 returns of a copy, {task}", "within 1e-6", text, gap <= 1e-6)


@pytest.mark.parametrize("task", vsp.paper.TASKS)
def test_evaluation_of_the_teacher(task, record):
    """Its forward passes are the floor. Their last bit decides an episode that comes to the very edge of the goal."""
    teacher, agent = vsp.load_teacher(task), teacher_agent(task)
    times = evaluations(teacher, agent, task)
    text, held = told(times, 100)
    what = f"1000 episodes of the teacher against evaluate_policy ({SLOW_EPISODES}, scaled), {task}"
    record("speed", what, "100 times", text, held, why="both go through its network")
    assert np.median(times[:, 1] / times[:, 0]) > 25
    direct, single, own = (
        evaluate_directly(agent, task, 1000, seed=1),
        *(outcomes(policy, task, 1000, seed=1).returns for policy in (OneByOne(agent), teacher)),
    )
    gap, others = np.abs(direct - single).max(), int((np.abs(direct - own) > 1e-5).sum())
    what = f"the same 1000 returns of the teacher, {task}"
    text = f"largest difference {gap:.1g}"
    record("speed", f"{what}, with the agent's actions", "within 1e-5", text, gap <= 1e-5)
    text = f"{others} of 1000 differ by more, the mean by {abs(direct.mean() - own.mean()):.1g}"
    why = "a float32 sum in another order decides an episode at the very edge of the goal"
    record("speed", f"{what}, with our forward pass", "within 1e-5", text, others == 0, why=why)
    assert abs(direct.mean() - own.mean()) < 0.1


def evaluations(ours, theirs, task: str) -> np.ndarray:
    """Seconds for 1000 episodes, ours and directly, these scaled from fewer. (repeats, 2)"""
    slow = partial(evaluate_directly, theirs, task, SLOW_EPISODES, seed=1)
    return race(lambda: outcomes(ours, task, 1000, seed=1), slow, calls=(3, 1)) * [1, 1000 / SLOW_EPISODES]


@pytest.mark.parametrize("task", vsp.paper.TASKS)
def test_one_state(task, record, tmp_path):
    agent, policy = teacher_agent(task), vsp.distill(vsp.load_teacher(task), task, seed=0)[0]
    env = gymnasium.make(task)
    observations = [env.reset(seed=seed)[0] for seed in range(100)]
    slow = lambda: [agent.predict(obs, deterministic=True) for obs in observations]  # noqa: E731
    times = race(lambda: [policy.predict(obs) for obs in observations], slow, calls=(20, 2), repeats=3 * REPEATS)
    text, held = told(times / len(observations), 20)
    what = f"predict of one state against the teacher's, {task}"
    record("speed", what, "20 times", text, held, why="a dozen calls of NumPy for whatever number of states")
    assert np.median(times[:, 1] / times[:, 0]) > 8
    times = race(program(policy, tmp_path), slow, repeats=3 * REPEATS)
    text, held = told(times / [CALLS, len(observations)], 1000)
    record("speed", f"the exported C against the teacher's predict, {task}", "1000 times", text, held)


CALLS = 2_000_000  # of the exported C
DRIVER = f"""
#include <stdio.h>
#include <stdlib.h>
int main(int n, char **files) {{
    static double states[1000][D];
    double action[M], sum = 0.0;
    FILE *file = fopen(files[n - 1], "rb");
    if (!file || fread(states, sizeof states, 1, file) != 1) return 1;
    for (int i = 0; i < {CALLS}; i++) {{
        vsp_act(states[i % 1000], action);
        sum += action[0];
    }}
    printf("%.17g\\n", sum);
    return 0;
}}
"""


def program(policy, folder):
    """The exported C, compiled with a loop around it: a function that lets it act `CALLS` times."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: `cc` is not there")
    low, high, m = policy.task.low, policy.task.high, len(policy.task.action_low)
    states = np.random.default_rng(0).uniform(low, high, size=(1000, len(low)))
    (folder / "states").write_bytes(states.tobytes())
    driver = DRIVER.replace("D]", f"{len(low)}]").replace("M]", f"{m}]")
    (folder / "policy.c").write_text(policy.to_c() + driver, encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-O2", "-o", folder / "policy", folder / "policy.c", "-lm"], check=True)
    expected = policy.predict(states)[0][:, 0].sum() * CALLS / 1000

    def act():
        told = subprocess.run([folder / "policy", folder / "states"], check=True, capture_output=True, text=True)
        assert np.isclose(float(told.stdout), expected, rtol=1e-6, atol=1e-3)

    return act


@pytest.mark.parametrize("task", vsp.paper.TASKS)
def test_memory_of_a_run(task, record):
    """Between 4 and 16 times the paper's iterations, where the number of snapshots no longer grows."""
    teacher, config = vsp.load_teacher(task), vsp.preset(task)
    vsp.distill(teacher, task, config.quick(), seed=0)
    peaks = {}
    for times in (1, 4, 16):
        longer = dataclasses.replace(config, n_epochs=times * config.n_epochs, n_freeze=times * config.n_freeze)
        tracemalloc.start()
        vsp.distill(teacher, task, longer, seed=0)
        peaks[times] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    each = (peaks[16] - peaks[4]) / (12 * config.n_epochs)
    sizes = ", ".join(f"{peak / 1e6:.1f}" for peak in peaks.values())
    text = f"peaks of {sizes} MB at 1, 4, 16 times the iterations: {each:.0f} bytes an iteration"
    to_hold = f"buffers bounded by n_reset; the history's 40 bytes an iteration, at most {MEMORY} in all"
    record("speed", f"memory of one run, {task}", to_hold, text, each <= MEMORY)
