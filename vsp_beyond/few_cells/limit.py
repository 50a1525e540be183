"""Find how close a few cells come to the best return: distil the best policy, then tune on the return. The result
depends on the initial policy, so several are tuned briefly, and only the best to the end."""

import warnings
from dataclasses import replace

import numpy as np

from vsp import Policy, Task, VoronoiPolicy, get_task, load_teacher, task_names
from vsp.checks import check_seed
from vsp.rollouts import rollout
from vsp.run.progress import steps

from ..optimum.references import TASKS, best_policy
from .config import TUNED, Tuned, faithful_preset, tuned_preset
from .faithful import distill_faithfully
from .tune import score
from .tuned import distill_tuned

VERSION = 2  # raise it when the same arguments give a different policy; tests/golden/methods.json checks this
# Initial policies, every second one a closest imitation; N_SLOW: for tasks with a physics engine
N_STARTS, N_SLOW = 12, 2
SCREENING = 0.2  # share of the generations for which each initial policy is tuned
N_AGAIN, AGAIN = 2, 0.4  # for such tasks: further searches, each from the last result, and their share of generations
PRICE = {"MountainCarContinuous-v0": 3e-3}  # per step: a car that arrives sooner tolerates a less exact imitation

_LIMIT = {
    "SimpleGoal-v0": replace(TUNED["SimpleGoal-v0"], n_cells=4, n_generations=400, n_tuning_episodes=500),
    "MountainCarContinuous-v0": replace(
        TUNED["MountainCarContinuous-v0"], n_cells=3, n_generations=100, tuning_step=0.03),
    "Pendulum-v1": replace(
        TUNED["Pendulum-v1"], n_cells=8, n_episodes=500, n_correction_episodes=300, n_restarts=6,
        n_generations=400, n_tuning_episodes=200, n_validation=2000),
    "LunarLanderContinuous-v3": replace(
        TUNED["LunarLanderContinuous-v3"], n_cells=3, n_generations=150, n_tuning_episodes=60,
        failure_penalty=100.0, n_validation=400),
}  # fmt: skip


def limit_preset(task: str | Task) -> Tuned:
    """Return the settings of `at_the_limit` for any task: those of `tuned_preset` with a longer search, and on some
    tasks with other cells, steps and penalties."""
    config = tuned_preset(task)
    return _LIMIT.get(get_task(task).name) or replace(config, n_generations=3 * config.n_generations)


def search_limit(task: str | Task, config: Tuned, *, seed: int, teacher: Policy | None = None) -> VoronoiPolicy:
    """Do what `vsp_beyond.at_the_limit` does."""
    check_seed(seed)
    task = get_task(task)
    teacher = _best_teacher(task) if teacher is None else teacher
    n_starts = N_SLOW if task.one_by_one else N_STARTS
    last, *seeds = np.random.SeedSequence(seed).generate_state(1 + n_starts + N_AGAIN).tolist()
    brief, again = (replace(config, n_generations=round(part * config.n_generations)) for part in (SCREENING, AGAIN))
    tried = steps(range(n_starts), "initial policies", total=n_starts, unit="searches")
    screened = [_screened(teacher, task, brief, seeds[i], closest=i % 2 == 0) for i in tried]
    validation = task.start(np.random.default_rng(last), config.n_validation)
    best = max(screened, key=lambda policy: score(rollout(policy, task, validation), config.failure_penalty))
    best = _tuned(best, teacher, task, config, last)
    for further in seeds[n_starts:] if task.one_by_one else ():
        best = _tuned(best, teacher, task, again, further)
    return best


def _best_teacher(task: Task) -> Policy:
    if task.name in TASKS:
        return best_policy(task, price=PRICE.get(task.name))
    if task.name not in task_names():
        raise ValueError(f"no teacher is known for {task.name}: pass one as `teacher`")
    return load_teacher(task.name)


def _screened(teacher: Policy, task: Task, config: Tuned, seed: int, *, closest: bool) -> VoronoiPolicy:
    """Return a briefly tuned initial policy: the `closest` imitation, or the best one for the return."""
    if not closest:
        return distill_tuned(teacher, task, config, seed=seed)[0]
    closest_fit = replace(faithful_preset(task, n_cells=config.n_cells), n_episodes=config.n_episodes, n_generations=0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no policy of")  # the return of this imitation does not matter yet
        policy, _ = distill_faithfully(teacher, task, closest_fit, seed=seed)
    return _tuned(policy, teacher, task, config, seed)


def _tuned(policy: VoronoiPolicy, teacher: Policy, task: Task, config: Tuned, seed: int) -> VoronoiPolicy:
    config = replace(config, n_cells=len(policy), n_restarts=1, n_corrections=0)
    return distill_tuned(teacher, task, config, seed=seed, start=policy)[0]
