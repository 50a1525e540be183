"""`make agents AGENTS=folder`: read, play and distil every agent of a folder, such as a clone of the public collection.

Agents are zips of Stable-Baselines3 and sb3-contrib, ALGORITHM-TASK.zip or TASK.zip below a folder ALGORITHM. Each is
distilled to the fewest of `SIZES` cells that act like it, those of MountainCar also by the paper's method. What cannot
be read or takes too long gets a row with the reason.
"""

import contextlib
import os
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd

from vsp import Task, VoronoiPolicy, get_task, load_teacher, start_states
from vsp.algorithms import VERSION, distill
from vsp.config import paper_preset
from vsp.evaluation import Likeness, likeness
from vsp.paper.baselines import refit
from vsp.protocol import Job, job
from vsp.protocol.job import provenance
from vsp.rollouts import visited_states
from vsp.run import atomic, command, sealed
from vsp.teachers import SHIPPED, Teacher
from vsp.teachers.normalization import statistics_beside
from vsp_beyond.few_cells import faithful_preset
from vsp_beyond.few_cells.faithful import distill_faithfully

from .committed import BEYOND, RESULTS, keys, read_results, write_results
from .comparison.methods import METHODS

SIZES, SEEDS, ENOUGH = (1, 2, 4, 8), range(5), 0.95  # cells, distillations of each size, their mean R²
N_EPISODES, START_SEED = 1000, 7  # of agent and policies, from starts that no fit saw
SECONDS = 600  # for one agent: no distillation begins later
PARTS = ("codewords", "coefficients", "scale")  # of a policy
POINTS = 61  # of a map, along each axis
CAR = "MountainCarContinuous-v0"
N_SEEN, SEEN_SEED = 400, 8  # episodes for maps by least squares, from starts of their own
TABLES = ("agents", "agents_paper")
ALGORITHMS = ("a2c", "ars", "crossq", "ddpg", "ppo", "sac", "td3", "tqc", "trpo")
COLUMNS = (
    "algorithm task weights zoo zoo_std agent agent_std agent_failing cells numbers r2 r2_least mean least most "
    "failing reason checksum settings teacher version"
).split()


def agents_in(folder: Path) -> dict[tuple[str, str], Path]:
    """Return the zips below `folder` by algorithm and task, the last version of each."""
    found = {}
    for path in sorted(folder.rglob("*.zip")):
        first, _, rest = path.stem.partition("-")
        named = (first, rest) if first in ALGORITHMS else (path.relative_to(folder).parts[0], path.stem)
        found[named] = path
    return found


def read(path: Path, task: str | Task) -> Teacher:
    """Return the agent in the zip at `path`, with the statistics of observations that lie beside it."""
    return load_teacher(path, task, normalize=statistics_beside(path))


def agent_of(algorithm: str, task: str, folder: str | os.PathLike = "") -> Teacher:
    """Return an agent: from the zips below `folder`, else a kept one. Raises CommandError where there is none."""
    agents = {path.stem.partition("-")[::2]: path for path in SHIPPED.glob("zoo/*.safetensors")}
    agents |= agents_in(Path(folder)) if folder else {}
    command.check_parameter(f"agent for {task}", algorithm, sorted(name for name, of in agents if of == task))
    return read(agents[algorithm, task], task)


@dataclass(frozen=True)
class Study(Job):
    """One zip: the kept policy of its agent, the map of its actions, and its rows."""

    algorithm: str
    task: str
    zip: Path
    seed: int = 0  # all of `SEEDS`
    kind = "Agent"

    @property
    def provenance(self) -> dict[str, str | int]:
        """The zip, and what the rows are made with, if the task is known."""
        settings: dict = {"paper": by_the_paper_with("")}
        with contextlib.suppress(ValueError, ImportError, gymnasium.error.Error):
            settings |= provenance_of(get_task(self.task), "")
        return provenance(settings, atomic.sha256(self.zip), VERSION)

    def make(self) -> tuple[dict, dict]:
        """Distil the agent."""
        row: dict = {"algorithm": self.algorithm, "task": self.task, "checksum": atomic.sha256(self.zip)}
        arrays: dict = {}
        papers: list[dict] = []
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the row says how good the policies are
                agent = read(self.zip, self.task)
                size, policy, alike = _fewest(agent)
                row |= _numbers(agent, size, policy, alike)
                actions = agent.predict(plane(agent.task)[2])[0] if self.task in PLANES else np.zeros((0, 1))
                arrays = {part: getattr(policy, part) for part in PARTS} | {"actions": actions}
            papers = [{"algorithm": self.algorithm, **each} for each in by_the_paper(agent)] if self.task == CAR else []
        except TimeoutError:
            row["reason"] = f"slower than {SECONDS // 60} minutes"
        except (ValueError, OSError, ImportError, gymnasium.error.Error) as error:
            row["reason"] = str(error).splitlines()[0].replace(f"{self.zip}: ", "")
        return arrays, {"row": row, "papers": papers}


def _fewest(agent: Teacher) -> tuple[int, VoronoiPolicy, list[Likeness]]:
    """Return the fewest of `SIZES` cells whose policies act like the agent, else the most; the first of these policies,
    and how alike all are."""
    began = time.monotonic()
    for size in SIZES:
        config = faithful_preset(agent.task, n_cells=size)
        policies = []
        for seed in SEEDS:
            if time.monotonic() - began > SECONDS:
                raise TimeoutError
            policies.append(distill_faithfully(agent, agent.task, config, seed=seed)[0])
        alike = [likeness(policy, agent, agent.task, N_EPISODES, seed=START_SEED) for policy in policies]
        if np.mean([one.r2 for one in alike]) >= ENOUGH:
            break
    return size, policies[0], alike


def _numbers(agent: Teacher, size: int, policy: VoronoiPolicy, alike: list[Likeness]) -> dict:
    """Return the numbers of a row: of the agent, of one policy, and of how alike those of all seeds are."""
    returns, n = alike[0].returns["agent"], len(alike[0].returns["agent"])
    means = [float(one.returns["policy"].mean()) for one in alike]
    numbers = {
        "weights": sum(part.size for layer in agent.layers for part in layer),
        "agent": float(returns.mean()), "agent_std": float(returns.std(ddof=1)),
        "cells": size, "numbers": policy.coefficients.size + policy.codewords.size * (len(policy) > 1),
        "r2": float(np.mean([one.r2 for one in alike])), "r2_least": min(one.r2 for one in alike),
        "mean": float(np.mean(means)), "least": min(means), "most": max(means),
    }  # fmt: skip
    if alike[0].failures["agent"] is not None:
        numbers["failing"] = float(np.mean([one.failures["policy"] for one in alike])) / n
        numbers["agent_failing"] = alike[0].failures["agent"] / n
    return numbers | provenance_of(agent.task, agent.digest)


def provenance_of(task: Task, digest: str) -> dict:
    """Return what the row of an agent was made with, apart from the agent's file."""
    presets = [vars(faithful_preset(task, n_cells=size)) for size in SIZES]
    settings = {"presets": presets, "seeds": [*SEEDS], "r2": ENOUGH, "starts": [N_EPISODES, START_SEED]}
    return provenance(settings, digest, METHODS["faithful"].version)


def by_the_paper_with(digest: str) -> dict:
    """Return what the rows of `by_the_paper` were made with, apart from the agent's file."""
    settings = {"config": paper_preset(CAR).settings(), "starts": [N_EPISODES, START_SEED, N_SEEN, SEEN_SEED]}
    return provenance(settings, digest, VERSION)


def current(name: str) -> tuple[pd.DataFrame, list[dict]]:
    """Return the rows of a committed table, and what each is made with today. Rows with a reason are left out."""
    rows = read_results(name).dropna(subset=["settings"])
    if name == "agents":
        return rows, [provenance_of(get_task(row.task), row.teacher) for row in rows.itertuples()]
    return rows, [{"seed": row.seed, **by_the_paper_with(row.teacher)} for row in rows.itertuples()]


def kept(checksum: str) -> tuple[dict, dict] | None:
    """Return what `Study.make` returned of a zip, from committed files; None if today it would return another."""
    tables = map(current, TABLES)
    agents, papers = (rows[[then == now for then, now in zip(keys(rows), keys(today))]] for rows, today in tables)
    for row in agents[agents["checksum"] == checksum].drop(columns=["zoo", "zoo_std"]).to_dict("records"):
        mine = papers[papers["teacher"] == row["teacher"]].to_dict("records")
        if mine or row["task"] != CAR:
            policy, actions = (find(row["algorithm"], row["task"]) for find in (policy_of, actions_of))
            return {part: getattr(policy, part) for part in PARTS} | {"actions": actions}, {"row": row, "papers": mine}
    return None


def by_the_paper(agent: Teacher) -> list[dict]:
    """Distil an agent of MountainCar by the paper's method; return rows of each seed, in three ways. The paper's
    settings; the same cells with maps by least squares; Adam with ten times the step size. `apart` is how many of the
    agent's states are farther from each other than a codeword must be from a state, `slope` the median coefficient of
    the velocity, without its sign, over the agent's states."""
    config, rows = paper_preset(CAR), []
    states = visited_states(agent, CAR, start_states(CAR, N_SEEN, SEEN_SEED))
    for seed in SEEDS:
        policy, apart = distill(agent, agent.task, config, seed=seed)[0], np.zeros((0, 2))
        larger = replace(config, learning_rate=10 * config.learning_rate)
        ways = {
            "paper": policy, "least squares": refit(policy, states, agent.predict(states)[0]),
            "larger steps": distill(agent, agent.task, larger, seed=seed)[0],
        }  # fmt: skip
        for state in visited_states(agent, CAR, start_states(CAR, 32, seed)):
            if (np.abs(apart - state).sum(axis=1) > config.min_pol_distance).all():
                apart = np.vstack([apart, state])
        for way, one in ways.items():
            alike = likeness(one, agent, CAR, N_EPISODES, seed=START_SEED)
            row = {"way": way, "seed": seed, "cells": len(one), "apart": len(apart)}
            slope = float(np.median(np.abs(one.coefficients[one.cells(states), 1, 0])))
            scores = {"slope": slope, "r2": alike.r2, "mean": float(alike.returns["policy"].mean())}
            failing = (alike.failures["policy"] or 0) / N_EPISODES
            rows.append(row | scores | {"failing": failing} | by_the_paper_with(agent.digest))
    return rows


def plane(task: str | Task, points: int = POINTS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a grid over the two variables of a task in `PLANES`: x (r, r), y (r, r), observations (r * r, d)."""
    low, high, observed = PLANES[get_task(task).name]
    x, y = np.meshgrid(*(np.linspace(*ends, points) for ends in zip(low, high)))
    return x, y, observed(x.ravel(), y.ravel())


PLANES = {
    CAR: ((-1.2, -0.07), (0.6, 0.07), lambda x, v: np.stack([x, v], axis=1)),
    "Pendulum-v1": ((-np.pi, -8.0), (np.pi, 8.0), lambda a, speed: np.stack([np.cos(a), np.sin(a), speed], axis=1)),
}


def policy_of(algorithm: str, task: str) -> VoronoiPolicy:
    """Return the committed policy of an agent, that of the first seed."""
    return VoronoiPolicy.load(RESULTS / "agents" / f"{algorithm}-{task}.policy")


def actions_of(algorithm: str, task: str) -> np.ndarray:
    """Return the committed actions of an agent on the `plane` of its task. (r * r, m)"""
    return sealed.load_arrays(RESULTS / "agents" / "actions.arrays", kind="Agents")[0][f"{algorithm}-{task}"]


def write(made: list[tuple[dict, dict]], out: Path) -> None:
    """Write tables, policies and maps to OUT/data/beyond, from what `Study.make` returned."""
    folder, maps = out / BEYOND / "agents", {}
    for arrays, about in made:
        if arrays:
            row = about["row"]
            name = f"{row['algorithm']}-{row['task']}"
            maps[name] = arrays.pop("actions")
            VoronoiPolicy(**arrays, task=row["task"], metric="euclidean").save(folder / f"{name}.policy")
    sealed.save_arrays(folder / "actions.arrays", maps, {"kind": "Agents"})
    frame = pd.DataFrame([about["row"] for _, about in made]).merge(read_results("zoo"), "left")
    frame = frame.reindex(columns=COLUMNS).sort_values(["task", "algorithm"])
    whole = dict.fromkeys(("version", "cells", "numbers", "weights"), "Int64")  # also where a row lacks them
    write_results(frame.astype(whole), "agents", out=out)
    write_results(pd.DataFrame([row for _, about in made for row in about["papers"]]), "agents_paper", out=out)


def main() -> None:
    """Study the agents of the folder that are not committed; write agents.csv, agents_paper.csv, policies and maps."""
    parser = command.parser(main.__doc__, "results: OUT/data/beyond, files: OUT/build/agents")
    parser.add_argument("agents", type=Path, help="a folder of zips")
    given = parser.parse_args()
    studies = [Study(*named, path) for named, path in agents_in(given.agents).items()]
    if not studies:
        raise command.CommandError(f"{given.agents}: no .zip below it, expected a folder of agents: AGENTS=folder")
    made = {study: kept(atomic.sha256(study.zip)) for study in studies}
    missing = [study for study, known in made.items() if known is None]
    folder = given.out / "build" / "agents"
    job.make_all(missing, folder, "agents", jobs=given.jobs, unit="agents")
    made |= {study: study.load(folder) for study in missing}
    write(list(made.values()), given.out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
