"""Speed and memory compared with the direct way, `tests/direct.py`: `make bench`."""

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
from vsp.evaluation import rollout_from_seed
from vsp.paper import printed

REPEATS = 5
SLOW_EPISODES = 100  # of the direct way; their time is scaled to 1000
MEMORY = 64  # bytes that each further iteration may take; 40 of them are the history's


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


def timed(work) -> tuple[float, object]:
    """Seconds that `work` takes, and its result."""
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def repeated(work, n: int) -> None:
    for _ in range(n):
        work()


def time_in_turns(quick, slow, *, calls=(1, 1), repeats: int = REPEATS) -> np.ndarray:
    """Seconds per call of both (repeats, 2), timed alternately after one call each as warm-up."""
    quick(), slow()
    sides = list(zip((quick, slow), calls))
    return np.array([[timed(partial(repeated, *side))[0] / side[1] for side in sides] for _ in range(repeats)])


def record_ratio(record, what: str, times: np.ndarray, at_least: float, *, why: str = "") -> float:
    """Record how many times faster the first column of `times` (n, 2) is than the second; return the median."""
    ratios = times[:, 1] / times[:, 0]
    ours, direct = (duration(t) for t in np.median(times, axis=0))
    about = {"low": ratios.min(), "high": ratios.max(), "note": f"{ours} against {direct}"}
    record("speed", what, np.median(ratios), "times", at_least=at_least, **about, why=why)
    return float(np.median(ratios))


def duration(t: float) -> str:
    unit, name = next((u, name) for u, name in ((1, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")) if t >= u)
    return f"{t / unit:.3g} {name}"


@pytest.mark.parametrize("task", printed.TASKS)
def test_one_distillation(task, record, monkeypatch):
    """At the paper's configuration; every pair of runs is compared as well."""
    teacher, agent, config = vsp.load_teacher(task), teacher_agent(task), vsp.preset(task)
    vsp.distill(teacher, task, config, seed=0)
    times, same = [], 0
    for seed in range(REPEATS):
        slow, found = timed(partial(distill_directly, agent, gymnasium.make(task), config, seed=seed))
        times.append((timed(partial(vsp.distill, teacher, task, config, seed=seed))[0], slow))
        same += same_run(found, teacher, task, config, seed, monkeypatch)
    note = "equal to the direct way, coefficients within 1e-9"
    record("speed", f"the same partition, {task}", same, f"of {REPEATS}", at_least=REPEATS, note=note)
    record_ratio(record, f"a distillation against the direct way, {task}", np.array(times), 40)


@pytest.mark.parametrize("task", printed.TASKS)
def test_evaluation_of_a_distilled_policy(task, record):
    policy = vsp.distill(vsp.load_teacher(task), task, seed=0)[0]
    what = f"1000 episodes of a distilled policy against evaluate_policy ({SLOW_EPISODES}, scaled), {task}"
    record_ratio(record, what, evaluations(policy, policy, task), 100)
    ours, direct = rollout_from_seed(policy, task, 1000, seed=1), evaluate_directly(policy, task, 1000, seed=1)
    what, gap = f"the same 1000 returns of a distilled policy, {task}", np.abs(direct - ours.returns).max()
    record("speed", what, gap, "largest difference", at_most=1e-6)


@pytest.mark.parametrize("task", printed.TASKS)
def test_evaluation_of_the_teacher(task, record):
    """Its forward passes bound the speed. Their last bit decides an episode that ends at the very edge of the goal."""
    teacher, agent = vsp.load_teacher(task), teacher_agent(task)
    what = f"1000 episodes of the teacher against evaluate_policy ({SLOW_EPISODES}, scaled), {task}"
    times, why = evaluations(teacher, agent, task), "both go through its network"
    assert record_ratio(record, what, times, 100, why=why) > 25
    direct, single, own = (
        evaluate_directly(agent, task, 1000, seed=1),
        *(rollout_from_seed(policy, task, 1000, seed=1).returns for policy in (OneByOne(agent), teacher)),
    )
    gap, others = np.abs(direct - single).max(), int((np.abs(direct - own) > 1e-5).sum())
    what = f"the same 1000 returns of the teacher, {task}"
    record("speed", f"{what}, with the agent's actions", gap, "largest difference", at_most=1e-5)
    about = {"note": f"the means by {abs(direct.mean() - own.mean()):.1g}"}
    about["why"] = "a float32 sum in another order decides an episode at the very edge of the goal"
    record("speed", f"{what}, with our forward pass", others, "of 1000 differ by over 1e-5", at_most=0, **about)
    assert abs(direct.mean() - own.mean()) < 0.1


def evaluations(ours, theirs, task: str) -> np.ndarray:
    """Seconds for 1000 episodes, ours and directly, these scaled from fewer. (repeats, 2)"""
    slow = partial(evaluate_directly, theirs, task, SLOW_EPISODES, seed=1)
    return time_in_turns(lambda: rollout_from_seed(ours, task, 1000, seed=1), slow, calls=(3, 1)) * [
        1,
        1000 / SLOW_EPISODES,
    ]


@pytest.mark.parametrize("task", printed.TASKS)
def test_one_state(task, record, tmp_path):
    agent, policy = teacher_agent(task), vsp.distill(vsp.load_teacher(task), task, seed=0)[0]
    env = gymnasium.make(task)
    observations = [env.reset(seed=seed)[0] for seed in range(100)]
    slow = lambda: [agent.predict(obs, deterministic=True) for obs in observations]  # noqa: E731
    quick = lambda: [policy.predict(obs) for obs in observations]  # noqa: E731
    times = time_in_turns(quick, slow, calls=(20, 2), repeats=3 * REPEATS) / len(observations)
    what, why = f"predict of one state against the teacher's, {task}", "a dozen calls of NumPy for any number of states"
    assert record_ratio(record, what, times, 20, why=why) > 8
    times = time_in_turns(program(policy, tmp_path), slow, repeats=3 * REPEATS) / [CALLS, len(observations)]
    record_ratio(record, f"the exported C against the teacher's predict, {task}", times, 1000)


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


@pytest.mark.parametrize("task", printed.TASKS)
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
    note = f"peaks of {sizes} MB at 1, 4, 16 times the iterations"
    record("speed", f"memory of a run, {task}", each, "bytes an iteration", at_most=MEMORY, note=note)
