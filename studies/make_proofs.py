"""`make proofs`: write certificates to data/beyond/proofs and results to data/beyond."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from vsp import VoronoiPolicy, load_teacher, start_states
from vsp.algorithms import distill
from vsp.config import paper_preset
from vsp.paper import published_policy, results
from vsp.paper.baselines import linear_map
from vsp.rollouts import collect_episodes, rollout
from vsp.run import command, listed
from vsp.run.progress import progress
from vsp.tasks import simplegoal
from vsp.teachers import Teacher
from vsp_beyond import Tuned, simplify, tuned_preset
from vsp_beyond.few_cells.tuned import distill_tuned
from vsp_beyond.proofs import check, prove
from vsp_beyond.proofs.mountaincar import prove_mountaincar
from vsp_beyond.proofs.pendulum import PendulumProof, prove_pendulum
from vsp_beyond.proofs.pendulum_starts import PARTS, shares_of_starts
from vsp_beyond.proofs.robust import largest_disturbance, outside_pit, steps_to_goal
from vsp_beyond.proofs.simplegoal_proof import ENDS, SimpleGoalProof

from .bounds import mean_return
from .committed import BEYOND, RESULTS, read_results, write_results

SIMPLEGOAL, MOUNTAINCAR, PENDULUM = "SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1"
N_SAMPLED = 1_000_000  # episodes sampled for comparison with a proof
MARGIN = 0.01  # margin for which simplegoal_margin is tuned: a tenth of a step
LOSS = 0.02  # share of the teacher's mean return that the simplified policy may lose


def main() -> None:
    """Prove the policies that are not proved yet. Write a certificate of each to data/beyond/proofs/ and the results to
    data/beyond/proofs.csv. After a new proof, also write that of Pendulum over smaller boxes to proofs_grid.csv."""
    given = command.parser(main.__doc__, "tables go to OUT/data/beyond, certificates to proofs/ in it").parse_args()
    if certificates(given.out, given.jobs):
        write_results(smaller_boxes(), "proofs_grid", out=given.out, float_format="%.12g")


def policies() -> dict[str, Callable[[], VoronoiPolicy]]:
    """Return functions that make the policies to prove, by the names of their certificates."""
    teacher, config, task = load_teacher(SIMPLEGOAL), tuned_preset(SIMPLEGOAL), simplegoal.TASK
    best = int(results.read_results(SIMPLEGOAL).set_index("seed")["mean"].idxmax())
    spacious = replace(task, step=partial(simplegoal.step, margin=MARGIN))
    return {
        "simplegoal_paper": lambda: published_policy(SIMPLEGOAL),
        "simplegoal_best_run": lambda: distill(teacher, task, paper_preset(SIMPLEGOAL), seed=best)[0],
        "simplegoal_faithful": lambda: _kept("faithful", SIMPLEGOAL),
        "simplegoal_tuned": lambda: distill_tuned(teacher, task, config, seed=0)[0],
        "simplegoal_limit": lambda: _kept("limit", SIMPLEGOAL),
        "simplegoal_simplified": lambda: _simplified(teacher, config),
        "simplegoal_one_map": lambda: _one_map(teacher),
        "simplegoal_margin": lambda: _of_simplegoal(
            distill_tuned(teacher, spacious, replace(config, n_cells=3), seed=1)[0]
        ),
        "mountaincar_limit": lambda: _kept("limit", MOUNTAINCAR),
        "pendulum_faithful": lambda: _kept("faithful", PENDULUM),
    }


def certificates(out: Path, jobs: int | str) -> list[str]:
    """Write the missing certificates and the table, row by row: an interrupted run can continue. Return their names."""
    folder = out / BEYOND
    rows = read_results("proofs", folder).to_dict("records") if (folder / "proofs.csv").exists() else []
    makers = policies()
    missing = [name for name in makers if name not in {row["name"] for row in rows}]
    for name in progress(missing, "proofs", total=len(makers), unit="policies", done=len(rows)):
        rows.append(_proved(name, makers[name](), folder / "proofs" / f"{name}.json", jobs))
        write_results(pd.DataFrame(rows), "proofs", out=out, float_format="%.12g")  # areas are small
    return missing


def _proved(name: str, policy: VoronoiPolicy, path: Path, jobs: int | str) -> dict:
    """Prove one policy. Write its certificate to `path` and return its row of the table."""
    began = time.perf_counter()
    proof = prove_mountaincar(policy, jobs=jobs) if policy.task.name == MOUNTAINCAR else prove(policy)
    seconds = time.perf_counter() - began
    path.parent.mkdir(parents=True, exist_ok=True)
    proof.save(path)
    listed.list_file(path)
    claim = check.check(path)
    row = {"name": name, "task": policy.task.name, "cells": len(policy), "metric": policy.metric}
    row |= {"longest": claim["longest"], "bytes": path.stat().st_size}
    row |= _of_simplegoal_proof(proof) if isinstance(proof, SimpleGoalProof) else {}
    row |= {name: claim[name] for name in ("n_states", "least", "mean_low", "mean_high") if name in claim}
    if policy.task.name == MOUNTAINCAR:
        row["goal"] = 1.0 - claim["n_left"] / claim["n_states"]
    if isinstance(proof, PendulumProof):
        row["goal"] = proof.share
    return row | _sampled(policy) | {"seconds": seconds}


def _of_simplegoal_proof(proof: SimpleGoalProof) -> dict:
    low, high = mean_return(proof.pieces)
    areas = {name: float(area) for name, area in proof.areas.items()}
    areas["failing_outside"] = float(proof.failing_outside)  # outside the pit
    row = {"pieces": len(proof.pieces), **areas, "mean_low": low, "mean_high": high}
    outside = outside_pit(steps := steps_to_goal(proof.policy))
    row |= {"program": float((steps > 0)[outside].mean()), "program_steps": int(steps[outside].max())}
    return row | {"disturbance": largest_disturbance(proof.policy)}


def _sampled(policy: VoronoiPolicy) -> dict:
    """Return mean return and shares of outcomes over `N_SAMPLED` episodes, a hundredth except on SimpleGoal."""
    n = N_SAMPLED if policy.task.name == SIMPLEGOAL else N_SAMPLED // 100
    played = rollout(policy, policy.task, start_states(policy.task, n, 1))
    shares = {f"sampled_{name}": float((played.outcomes == end).mean()) for end, name in ENDS.items()}
    return {"sampled": n, "sampled_mean": float(played.returns.mean()), **shares}


def smaller_boxes() -> pd.DataFrame:
    """Prove from which share of its starts Pendulum gets upright, by a grid and by smaller boxes of starts."""
    began = time.perf_counter()
    proof = prove_pendulum(_kept("faithful", PENDULUM))
    shares = shares_of_starts(proof)
    boxes = [len(proof.steps) * PARTS**level for level in range(len(shares))]
    return pd.DataFrame({"boxes": boxes, "share": shares, "seconds": time.perf_counter() - began})


def _kept(table: str, task: str) -> VoronoiPolicy:
    return VoronoiPolicy.load(RESULTS / f"{table}_{task}.policy")


def _simplified(teacher: Teacher, config: Tuned) -> VoronoiPolicy:
    """Make the simplest policy that loses at most `LOSS` of the teacher's mean return."""
    returns = rollout(teacher, SIMPLEGOAL, start_states(SIMPLEGOAL, config.n_validation, 0)).returns
    return simplify(teacher, SIMPLEGOAL, config, tolerance=LOSS * abs(returns.mean()), seed=0)[0]


def _one_map(teacher: Teacher) -> VoronoiPolicy:
    episodes = collect_episodes(teacher, SIMPLEGOAL, start_states(SIMPLEGOAL, 1000, 0))
    return linear_map(episodes.states, episodes.actions, SIMPLEGOAL)


def _of_simplegoal(policy: VoronoiPolicy) -> VoronoiPolicy:
    """Convert a policy for SimpleGoal with a margin to one for SimpleGoal."""
    return VoronoiPolicy(
        policy.codewords, policy.coefficients, task=SIMPLEGOAL, metric=policy.metric, scale=policy.scale
    )


if __name__ == "__main__":
    with command.in_one_line():
        main()
