"""`make hidden`: search for the settings that the paper does not print, by approximate Bayesian computation.

Settings are drawn from a prior (`PRIOR`), the same for both tasks but for the teacher. Each is tried with one seed and
few starts; the nearest tenth of each task, and the nearest twentieth of both together, again with four other seeds; the
nearest of these with 60 fresh ones. "Near" compares every value that the paper prints of distilled policies: returns,
outliers, cells and coefficients. All stages write rows, so that an interrupted search goes on.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from vsp import Policy, VoronoiPolicy, get_task, load_teacher, start_states
from vsp.algorithms import distill
from vsp.geometry import METRICS
from vsp.paper import printed
from vsp.paper.ledger import ledger_table
from vsp.paper.readings import Readings
from vsp.paper.results import RESULTS, read_results, write_results
from vsp.paper.runs import N_RUNS, Experiment, paper_experiment, results_of
from vsp.paper.statistics import outlier_numbers, quartiles_from_fences, spread
from vsp.protocol import share_interval
from vsp.protocol.job import settings_id
from vsp.rollouts import rollout
from vsp.run import workers
from vsp.teachers import SHIPPED

VERSION = 1  # raise it when the same settings give other rows
N_SETTINGS, PRIOR_SEED = 4000, 777
N_NEAR, N_NEAR_BOTH = N_SETTINGS // 10, N_SETTINGS // 20  # settings tried again: nearest of each task, and of both
N_POSTERIOR, N_CONFIRMED = 100, 2  # the nearest of these, and the nearest that are confirmed
CAP = 5.0  # one value counts at most so much, in deviations of a run
SIMPLEGOAL, MOUNTAINCAR = TASKS = printed.TASKS
# Files of teachers, the shipped one first. SimpleGoal: two with shorter training, which fall into the pit now and then,
# as the printed one does. MountainCar: one with the printed mean, and the RL Zoo's DDPG agent, a sibling of the paper's
TEACHERS = {
    SIMPLEGOAL: (SIMPLEGOAL, "short/SimpleGoal-v0-2", "short/SimpleGoal-v0-3"),
    MOUNTAINCAR: (MOUNTAINCAR, "short/MountainCarContinuous-v0-1", "zoo/ddpg-MountainCarContinuous-v0"),
}
# Answers to each open question, with their weights. Long runs are rare, so that the search ends: 50 minibatches of 256
# states are a pass over a buffer
PRIOR: dict[str, dict] = {
    "teacher": {0: 2, 1: 1, 2: 1},
    "freeze": {"last_n_freeze": 2, "first_n_freeze": 1, "last_n_split": 1},
    "split_lookup": {"refreshed": 1, "kept": 1},
    "split_metric": {"manhattan": 1, "euclidean": 1},
    "one_split": {False: 3, True: 1},
    "periodic_reset": {"buffers": 2, "off": 1},
    "merge_reset": {"survivor_and_neighbours": 1, "neighbours": 1},
    "merge_visits_removed": {False: 2, True: 1},
    "batch_size": dict.fromkeys((16, 32, 64, 128, 256), 1),
    "n_minibatches": {1: 8, 2: 6, 3: 5, 5: 5, 10: 3, 20: 1, 50: 0.25},
    "learning_rate": dict.fromkeys((1e-4, 3e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2), 1),
    "initial": {"uniform": 1, "zeros": 1},
    "adam_on_reset": {"keep": 1, "restart": 1},
    "scale": {"raw": 3, "box": 1},
    "neighbours": {"delaunay": 4, "lookup": 1},
    "split_loss": {"raw": 1, "clipped": 1},
    "merge_parameters": {"all": 1, "weights": 1},
    "split_reset": {"cell_and_neighbours": 1, "neighbours": 1},
    "split_neighbours": {"old": 1, "new": 1},
    "loss_after_split": {"reset": 1, "kept": 1},
    "inclusive": {False: 3, True: 1},
}
# Of each stage: seeds of the runs, seed of the start states, and how many of these. The first are the default's alone,
# and show how much a single run varies
STAGES = {
    "variation": (range(5000, 5060), 31, 200), "screening": (range(3000, 3001), 31, 200),
    "near": (range(3001, 3005), 32, 400), "confirming": (range(4000, 4060), 33, 1000),
}  # fmt: skip
EXTREMES = ("min", "max")  # which depend on the number of episodes: recorded, but no part of the distance
OF_RETURNS = {  # without values that follow from others
    SIMPLEGOAL: ("mean", "std", "q1", "median", "q3", "outliers", "outliers_mean", "outliers_std"),
    MOUNTAINCAR: ("mean", "std", "q1", "q3", "outliers", "outliers_below_share", "outliers_below_mean",
                  "outliers_below_std", "outliers_above_mean", "outliers_above_std"),
}  # fmt: skip


def setting(k: int) -> dict:
    """Draw setting k from the prior; setting 0 is the default."""
    rng, answers = np.random.default_rng([PRIOR_SEED, k]), {name: [*weights] for name, weights in PRIOR.items()}
    shares = {name: np.array([*weights.values()]) / sum(weights.values()) for name, weights in PRIOR.items()}
    drawn = {name: answers[name][rng.choice(len(share), p=share)] for name, share in shares.items()}
    return drawn if k else {}


def experiment(change: dict, task: str) -> Experiment:
    """Return the paper's experiment with changed settings: fields of `Config` and `Readings`, and a teacher."""
    usual, teacher = _usual(task), _teacher(SHIPPED / f"{TEACHERS[task][change.get('teacher', 0)]}.safetensors")
    passes = {name: value for name, value in change.items() if hasattr(Readings, name)}
    config = {name: value for name, value in change.items() if name not in passes and name != "teacher"}
    readings = Readings(**passes) if passes else None
    return replace(usual, config=replace(usual.config, **config), readings=readings, teacher=teacher)


_usual, _teacher = cache(paper_experiment), cache(load_teacher)


def of_partitions(policies: Iterable[VoronoiPolicy]) -> dict[str, float]:
    """Describe partitions: cells; the largest coefficient, and the median one, by size; and the share of pairs of
    codewords that are nearer than a new codeword may be to its own (means over policies)."""
    rows = []
    for policy in policies:
        sizes, limit = np.abs(policy.coefficients), _usual(policy.task.name).config.min_pol_distance
        gaps = METRICS["manhattan"].distances(policy.codewords, policy.codewords)
        close = (gaps[np.triu_indices(len(policy), 1)] < limit).mean() if len(policy) > 1 else 0.0
        rows.append({"cells": len(policy), "largest": sizes.max(), "middle": np.median(sizes), "close": close})
    return pd.DataFrame(rows).mean().to_dict()


def facts(task: str, policies: Iterable[VoronoiPolicy], returns: np.ndarray) -> dict[str, float]:
    """Return what the paper prints of distilled policies, measured on these and their returns (p, n)."""
    numbers = spread(returns) | outlier_numbers(returns)
    numbers["outliers"] *= 100 / returns.size  # in percent
    return {name: numbers[name] for name in (*OF_RETURNS[task], *EXTREMES)} | of_partitions(policies)


def printed_facts(task: str) -> dict[str, float]:
    """Return the paper's values of `facts`. MountainCar's quartiles follow from the bounds in the text (`audit`)."""
    prefix, known = printed.PREFIX[task], printed.printed_text_numbers()["value"]
    values = printed.printed_spread_values(task, "ours")
    values |= {name: known[f"{prefix}_ours_{name}"] for name in OF_RETURNS[task] if name.startswith("outliers")}
    values["outliers"] *= 100 / known[f"{prefix}_total_episodes"]
    if task == MOUNTAINCAR:
        values["q1"], values["q3"] = quartiles_from_fences(known["mc_ours_whisker_low"], known["mc_ours_whisker_high"])
    shown = {name: values[name] for name in (*OF_RETURNS[task], *EXTREMES)}
    return shown | of_partitions([printed.published_policy(task)])


# The stages


@lru_cache(maxsize=16)
def _remembered(task: str, teacher: int, seed: int) -> Policy:
    """Return a teacher that remembers its answers: runs with this seed, and other settings, ask it the same."""
    asked, known = experiment({"teacher": teacher}, task).teacher, dict[bytes, np.ndarray]()

    def predict(obs: np.ndarray) -> tuple[np.ndarray, None]:
        key = obs.tobytes()
        if key not in known:
            known[key] = asked.predict(obs)[0]
        return known[key], None

    return SimpleNamespace(predict=predict)


def tried(task: str, stage: str, k: int) -> dict[str, float]:
    """Try setting k; return `facts`. In the stage "variation", k is the seed of a run with the default."""
    (seeds, start_seed, n), change = STAGES[stage], {} if stage == "variation" else setting(k)
    one, starts = experiment(change, task), start_states(task, n, start_seed)
    passes = {"split": one.readings.split, "merge": one.readings.merge} if one.readings else {}
    policies = []
    for seed in [k] if stage == "variation" else seeds:
        teacher = _remembered(task, change.get("teacher", 0), seed)
        policies.append(distill(teacher, get_task(task), one.config, seed=seed, **passes)[0])
    return facts(task, policies, np.stack([rollout(policy, task, starts).returns for policy in policies]))


def provenance_of(task: str, stage: str, k: int) -> dict[str, str | int]:
    """Return the provenance of a row; the version is that of the paper's method."""
    one, (seeds, *starts) = experiment({} if stage == "variation" else setting(k), task), STAGES[stage]
    settings = {"runs": one.settings, "seeds": [*seeds], "starts": starts, "study": VERSION}
    return one.provenance | {"settings": settings_id(settings)}


def rows_of(task: str, stage: str, numbers: Iterable[int], out: Path, jobs: int | str) -> pd.DataFrame:
    """Return the rows of some settings: those in OUT, or else committed, that are made with today's settings, and those
    that are missing, which are made."""
    name, folders = f"hidden_{task}", (out / "data" / "results", RESULTS)
    folder = next((folder for folder in folders if (folder / f"{name}.csv").exists()), None)
    kept = read_results(name, folder).to_dict("records") if folder else []
    rows = {(row["stage"], row["k"]): row for row in kept}
    rows = {key: row for key, row in rows.items() if provenance_of(task, *key).items() <= row.items()}
    asked = [(task, stage, k) for k in numbers if (stage, k) not in rows]
    about: dict = {"jobs": jobs, "total": len(asked), "unit": "settings"}
    for n, (i, row) in enumerate(workers.results(tried, asked, f"{task}, {stage}", **about), 1):
        k = asked[i][2]
        rows[stage, k] = {"stage": stage, "k": k, **row, **provenance_of(*asked[i])}
        if n % 50 == 0 or n == len(asked):  # an interrupted search goes on from here
            order = sorted(rows, key=lambda key: ([*STAGES].index(key[0]), key[1]))
            write_results(pd.DataFrame([rows[key] for key in order]), name, out=out, float_format="%.6g")
    frame = read_results(name, folders[0] if asked else folder)  # rounded, also what was just made
    return frame[(frame["stage"] == stage) & frame["k"].isin([*numbers])].reset_index(drop=True)


# What is near


def scales(task: str, variation: pd.DataFrame) -> pd.Series:
    """Return how much each of `facts` varies from run to run of the default: half of the middle 68 %."""
    low, high = (variation[[*printed_facts(task)]].quantile(share) for share in (0.16, 0.84))
    return np.maximum((high - low) / 2, 1e-3 * np.maximum(1.0, pd.Series(printed_facts(task)).abs()))


def distances(task: str, rows: pd.DataFrame, variation: pd.DataFrame) -> pd.Series:
    """Return how far each row is from the paper: the mean over all printed values but the extremes, each in units of
    the default's variation from run to run, and at most `CAP`."""
    wanted = pd.Series(printed_facts(task)).drop([*EXTREMES])
    away = ((rows.set_index("k")[wanted.index] - wanted).abs() / scales(task, variation)).clip(upper=CAP)
    return away[wanted.index].fillna(CAP).mean(axis=1)


def search(out: Path, jobs: int | str) -> None:
    """Make all stages; write the rows of each task as they come, then hidden_questions, _reached and _facts.csv."""

    def made(stage: str, numbers: dict[str, Iterable[int]]) -> dict[str, pd.DataFrame]:
        return {task: rows_of(task, stage, numbers[task], out, jobs) for task in TASKS}

    def away(rows: dict[str, pd.DataFrame]) -> dict[str, pd.Series]:
        each = {task: distances(task, rows[task], variation[task]) for task in TASKS}
        return each | {"both": pd.DataFrame(each).mean(axis=1, skipna=False).dropna()}

    variation = made("variation", dict.fromkeys(TASKS, STAGES["variation"][0]))
    every = made("screening", dict.fromkeys(TASKS, range(N_SETTINGS)))
    screened = away(every)
    both = screened["both"].nsmallest(N_NEAR_BOTH).index
    near = made("near", {task: sorted({0, *screened[task].nsmallest(N_NEAR).index, *both}) for task in TASKS})
    nearest = away(near)
    first = sorted({0, *(k for each in nearest.values() for k in each.nsmallest(N_CONFIRMED).index)})
    confirmed = made("confirming", dict.fromkeys(TASKS, first))
    first_of = {who: int(each.idxmin()) for who, each in away(confirmed).items()}
    chosen = {"default": 0} | {f"nearest, {printed.SHORT.get(who, who)}": k for who, k in first_of.items()}
    write_results(questions(nearest), "hidden_questions", out=out)
    parts = {}
    for task in TASKS:
        best = near[task].set_index("k").loc[nearest[task].nsmallest(N_POSTERIOR).index]
        fresh = confirmed[task].set_index("k").loc[[*chosen.values()]].set_axis([*chosen])
        parts[task] = reached(task, every[task], best, fresh).assign(scale=scales(task, variation[task]))
    write_results(pd.concat(parts, names=["task", "name"]).reset_index(), "hidden_reached", out=out)
    write_results(facts_of(chosen, out / "build" / "study", jobs), "hidden_facts", out=out)


def reached(task: str, every: pd.DataFrame, nearest: pd.DataFrame, fresh: pd.DataFrame) -> pd.DataFrame:
    """Return which printed values the settings reach: one row per name of `facts`. Columns: paper; of all settings that
    were screened least, low, high and most (low and high: the middle 95 %); low and high of the nearest; and the values
    of each row of `fresh`, which are settings with fresh seeds."""
    paper = pd.Series(printed_facts(task))
    every, nearest, fresh = (frame[paper.index] for frame in (every, nearest, fresh))
    found = pd.concat([every.quantile([0, 0.025, 0.975, 1]), nearest.quantile([0.025, 0.975]), fresh]).T
    columns = ["least", "low", "high", "most", "nearest low", "nearest high", *fresh.index]
    return found.set_axis(columns, axis=1).assign(paper=paper)


def questions(near: dict[str, pd.Series]) -> pd.DataFrame:
    """Return what the nearest settings say of each open question: one row per answer. Columns: question, answer, prior
    (its share), and for each task and both the share among the nearest `N_POSTERIOR` (of both tasks: a quarter of
    these) with its 95 % interval."""
    rows = []
    for name, weights in PRIOR.items():
        for answer, weight in weights.items():
            row = {"question": name, "answer": answer, "prior": weight / sum(weights.values())}
            for who, each in near.items():
                nearest = each.nsmallest(N_POSTERIOR if who != "both" else N_POSTERIOR // 4).index
                count = sum(setting(k).get(name) == answer for k in nearest)
                low, high = share_interval(count, len(nearest))
                row |= {who: count / len(nearest), f"{who}_low": low, f"{who}_high": high}
            rows.append(row)
    return pd.DataFrame(rows)


def facts_of(chosen: dict[str, int], runs: Path, jobs: int | str) -> pd.DataFrame:
    """Return the ledger's facts of distilled policies at the paper's scale, with the settings of each choice."""
    tables = []
    for name, k in chosen.items():
        tried = {task: experiment(setting(k), task) for task in TASKS}
        made = {task: results_of(one, N_RUNS[task], runs=runs, jobs=jobs) for task, one in tried.items()}
        book = ledger_table(made).query("fact and subject == 'Ours'")
        columns = ["id", "task", "quantity", "paper", "here", "low", "high", "verdict"]
        tables.append(book[columns].assign(choice=name, k=k, **{"settings in words": in_words(k)}))
    return pd.concat(tables, ignore_index=True)


def in_words(k: int) -> str:
    """Return what setting k changes of the default, as "name value" after one another."""
    usual = {name: next(iter(weights)) for name, weights in PRIOR.items()} | {"batch_size": 64, "learning_rate": 1e-3}
    return ", ".join(f"{name} {value}" for name, value in setting(k).items() if value != usual[name])
