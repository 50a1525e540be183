"""Everything that Python computes for the article: the scene and what the text says of it, the teacher's network, one
run of the paper's method, the episodes that it learnt from, and the exact areas of failing starts.

All for SimpleGoal. Numbers of arrays are little-endian float32 in base64, those of policies exact.
"""

from __future__ import annotations

import base64
import dataclasses
import functools
from fractions import Fraction

import numpy as np

import vsp
from studies import comparison
from studies.committed import read_results
from studies.comparison import measure
from vsp import VoronoiPolicy
from vsp.algorithms import EPISODES_AHEAD
from vsp.paper.baselines import linear_map, refit
from vsp.paper.printed import published_policy
from vsp.paper.results import read_results as read_paper_results
from vsp.rollouts import Episodes, Policy, rollout
from vsp.show import state_space
from vsp.show.explorer.scene import encoded, network_of, scene_of, starts_of
from vsp.tasks.base import GOAL, RUNNING
from vsp.tasks.simplegoal import PIT_LOW, TASK
from vsp_beyond.optimum import best_policy, best_returns
from vsp_beyond.proofs import load_certificate
from vsp_beyond.proofs.polygons import Polygon, total
from vsp_beyond.proofs.simplegoal import SQUARE, Loop, Piece
from vsp_beyond.proofs.simplegoal_proof import SIDES

SEED = 0  # of the run, as in notebook 02
N_REFIT = EPISODES_AHEAD  # episodes to refit on: the first of those from which the run learnt
MARGIN = 0.05  # between a codeword that is drawn in and the edge of the plane
OUT_OF_PLACE = (0.4, 0.3)  # where a codeword lies in section 7
FIRST = (0.9, 0.8)  # the start that is chosen at first
N_FIT = 200  # episodes that the one linear map is fitted to
N_CUTS = 3  # steps after which the square is shown in pieces
N_ARROWS = 14  # along each axis, as in picture.js
DIGITS = {"paper": 7, "margin": 12}  # of the corners of failing starts: the margin's are to be enlarged
NAMES = {
    "one_map": "one linear map, by least squares",
    "run": "a rerun of the paper's method",
    "paper": "the paper's, as published",
    "faithful_8": "faithful, eight cells",
    "faithful_4": "faithful, four cells",
    "faithful_3": "faithful, three cells",
    "tuned_1": "one linear map, tuned for the return",
    "margin": "tuned with a margin, three cells",
    "three": "three cells that pass the pit on both sides",
    "misplaced": "the three cells, one codeword out of place",
}


def parts() -> dict[str, dict]:
    """Return the parts of the article's data by name, each JSON-serialisable: the same on every machine whose kernels
    are fixed."""
    return {"scene": scene(), "teacher": network_of(teacher()), "run": run(), "visited": visited(), "proofs": proofs()}


# Policies


@functools.cache
def teacher() -> vsp.Teacher:
    """Return the teacher of SimpleGoal."""
    return vsp.load_teacher(TASK.name)


@functools.cache
def distilled() -> tuple[VoronoiPolicy, vsp.History]:
    """Return the policy and the history of the run of notebook 02."""
    return vsp.distill(teacher(), TASK.name, vsp.preset(TASK.name), seed=SEED, progress=False)


@functools.cache
def policies() -> dict[str, VoronoiPolicy]:
    """Return the policies of the article, in the order of `NAMES`."""
    on_both_sides = np.zeros((3, 3, 2))  # of earlier links
    on_both_sides[:, 2] = [[-1.0, -1.0], [-0.8, -1.0], [-1.0, -0.8]]
    episodes = vsp.collect_episodes(teacher(), TASK, vsp.start_states(TASK, N_FIT, 0))
    made = {
        "one_map": linear_map(episodes.states, episodes.actions, TASK.name),
        "run": distilled()[0],
        "paper": published_policy(TASK.name),
        "faithful_8": kept("faithful"),
        "faithful_4": kept("faithful", "_size_4"),
        "faithful_3": drawn_in(kept("faithful", "_size_3")),
        "tuned_1": kept("limit", "_size_1"),
        "margin": load_certificate("simplegoal_margin")[0],
        "three": VoronoiPolicy([[0.25, 0.25], [0.75, 0.4], [0.4, 0.75]], on_both_sides, task=TASK),
        "misplaced": misplaced(drawn_in(kept("faithful", "_size_3"))),
    }
    return {name: made[name] for name in NAMES}


def kept(table: str, size: str = "") -> VoronoiPolicy:
    """Return the policy that is kept of a table of the studies."""
    return VoronoiPolicy.load(comparison.RESULTS / f"{table}_{TASK.name}{size}.policy")


def drawn_in(policy: VoronoiPolicy) -> VoronoiPolicy:
    """Return a policy of three Euclidean cells with the same borders, drawn by codewords inside the plane.

    The borders depend only on the directions of the codewords from the point that is equally far from all three.
    """
    points = policy.codewords / policy.scale
    lengths = np.square(points).sum(axis=1)
    middle = np.linalg.solve(2 * (points[1:] - points[0]), lengths[1:] - lengths[0]) * policy.scale
    ways = policy.codewords - middle
    room = np.where(ways > 0, 1 - MARGIN - middle, middle - MARGIN)  # to the nearest edge in each direction
    codewords = middle + ways * (room / np.abs(ways)).min()
    return VoronoiPolicy(codewords, policy.coefficients, task=TASK, metric=policy.metric, scale=policy.scale)


def misplaced(policy: VoronoiPolicy) -> VoronoiPolicy:
    """Return a policy whose last codeword is at `OUT_OF_PLACE`, all numbers with two digits, as a link carries them."""
    codewords = policy.codewords.round(2)
    codewords[-1] = OUT_OF_PLACE
    return VoronoiPolicy(
        codewords, policy.coefficients.round(2), task=TASK, metric=policy.metric, scale=policy.scale.round(2)
    )


def longer(more: int) -> int:
    """Return from how many starts the run fails if its maps are trained for `more` iterations, in the same cells.

    Raises ValueError if the cells are not the same.
    """
    config = vsp.preset(TASK.name)
    config = dataclasses.replace(config, n_epochs=config.n_epochs + more, n_freeze=config.n_freeze + more)
    policy, _ = vsp.distill(teacher(), TASK.name, config, seed=SEED, progress=False)
    if not np.array_equal(policy.codewords, distilled()[0].codewords):
        raise ValueError(f"a run of {more} more iterations has other cells, expected the same")
    return played(policy)["failures"]


@functools.cache
def learnt_from() -> Episodes:
    """Return the first episodes of the teacher from which the run learnt."""
    starts = TASK.start(np.random.default_rng(np.random.SeedSequence(SEED).spawn(3)[0]), N_REFIT)  # as `distill` draws
    return vsp.collect_episodes(teacher(), TASK, starts)


# The scene


def walks() -> dict:
    """Return the teacher's episodes from the scene's starts: how many states each has, and all states in units of
    1/65535, little-endian, as base64."""
    episodes = vsp.collect_episodes(teacher(), TASK, starts_of(TASK))
    ends = [TASK.step(each.states[-1:], each.actions[-1:])[0] for each in episodes]
    ways = [np.concatenate([each.states, end]) for each, end in zip(episodes, ends)]
    whole = np.concatenate(ways).astype(float) * 65535
    stored = base64.b64encode(whole.round().astype("<u2").tobytes()).decode()
    return {"lengths": [len(way) for way in ways], "states": stored}


def scene() -> dict:
    """Return task, plane, starts and policies as the explorer has them, and what the text says."""
    made = scene_of({NAMES[name]: policy for name, policy in policies().items()}, TASK)
    shown = {"teacher": taught()} | dict(zip(NAMES, made["policies"]))
    made["policies"] = {name: about | {"r2": says()[f"{name}_r2"]} for name, about in shown.items()}
    shown = {"teacher": played(teacher()), "moments": len(run()["n"]), "walks": walks()}
    return made | shown | {"says": says()}


def taught() -> dict:
    """Return what is known of the teacher before its network is loaded: its arrows, one episode, its results."""
    centres = (np.arange(N_ARROWS) + 0.5) / N_ARROWS
    points = np.stack(np.meshgrid(centres, centres[::-1]), axis=-1).reshape(-1, 2)  # from the top left, row by row
    (episode,) = vsp.collect_episodes(teacher(), TASK, np.array([FIRST]))
    end, _, outcome = TASK.step(episode.states[-1:], episode.actions[-1:])
    shown = {"states": np.concatenate([episode.states, end]).tolist(), "outcome": int(outcome[0])}
    arrows = teacher().predict(points)[0].astype(float).round(3).tolist()
    return {"name": "the teacher", "layers": [], "arrows": arrows, "episode": shown, "results": played(teacher())}


def played(policy: Policy) -> dict:
    """Return mean return and number of failures from the scene's starts."""
    mean = float(rollout(policy, TASK, starts_of(TASK)).returns.mean())
    return {"mean": mean, "failures": int(failing(policy).sum())}


def best() -> dict:
    """Return the best possible mean return from the scene's starts, in closed form, and from how many the policy fails
    that reaches it, less 1e-5."""
    return {"mean": float(best_returns(starts_of(TASK)).mean()), "failures": played(best_policy(TASK))["failures"]}


@functools.cache
def says() -> dict[str, float | str]:
    """Return every number that the text quotes, and a start as text."""
    numbers: dict[str, float | str] = {"weights": sum(part.size for layer in teacher().layers for part in layer)}
    numbers["first_steps"] = len(vsp.collect_episodes(teacher(), TASK, np.array([FIRST]))[0].states)
    numbers |= {f"best_{what}": value for what, value in best().items()}
    states = measure.common_states(teacher(), TASK)  # 10,000 new ones
    for name, policy in {"teacher": teacher(), **policies(), **repaired()}.items():
        numbers |= {f"{name}_{what}": value for what, value in played(policy).items()}
        numbers[f"{name}_r2"] = measure.fidelity(policy, teacher(), TASK, states)["r2"]
    numbers |= {f"scale_{axis}": value for axis, value in zip("xy", policies()["faithful_3"].scale.tolist())}
    numbers |= {"turns_at": turns_at(), "one_change": changed("one_map", 0, 1, 1, 1.0)}  # the number of y in Δy
    three = policies()["faithful_3"]
    numbers |= {"three_numbers": three.codewords.size + three.coefficients.size} | aloud(three)
    return numbers | about_run() | about_spike() | from_tables()


def turns_at(y: float = 0.9) -> float:
    """Return where, from left to right along y, the teacher begins to pass the pit on its right side."""
    starts = np.array([[x, y] for x in np.arange(0.65, 1.0, 0.001)])
    ways = [each.states for each in vsp.collect_episodes(teacher(), TASK, starts)]
    left = [way[(way < PIT_LOW).any(axis=1)][0, 0] < PIT_LOW for way in ways]
    return float(starts[left.index(False), 0])


def aloud(policy: VoronoiPolicy) -> dict[str, float]:
    """Return what is read aloud of three cells: the greatest Δx of the first and the greatest Δy of the second, over a
    grid of the square, and the numbers of x and y that the first Δx has."""
    points = state_space.grid(TASK.low, TASK.high, 401)[2]
    maps, cells = policy.coefficients, policy.cells(points)
    most = [(points[cells == i] @ maps[i, :2] + maps[i, 2])[:, i].max() for i in (0, 1)]
    left, down = (np.ceil(10 * value) / 10 for value in most)  # so that "below" is true
    return {"goes_left": left, "goes_down": down, "of_x": maps[0, 0, 0], "of_y": -maps[0, 1, 0]}


def changed(name: str, cell: int, term: int, action: int, value: float) -> int:
    """Return from how many starts a policy fails if one number of its maps is another."""
    maps = policies()[name].coefficients.copy()
    maps[cell, term, action] = value
    return played(VoronoiPolicy(policies()[name].codewords, maps, task=TASK))["failures"]


def failing(policy: Policy) -> np.ndarray:
    """Return for each of the scene's starts whether a policy fails from it. (n,)"""
    return rollout(policy, TASK, starts_of(TASK)).outcomes != GOAL


@functools.cache
def failing_cells() -> np.ndarray:
    """Return for each cell of the run how many failing episodes take their last step in it. (k,)"""
    policy = policies()["run"]
    return np.bincount(last_cells(policy), minlength=len(policy))


def last_cells(policy: VoronoiPolicy) -> np.ndarray:
    """Return for each of the scene's starts that fail the cell in which its episode takes its last step. (n,)"""
    episodes = vsp.collect_episodes(policy, TASK, starts_of(TASK)[failing(policy)])
    return policy.cells(np.array([each.states[-1] for each in episodes]))


@functools.cache
def repaired() -> dict[str, VoronoiPolicy]:
    """Return the run's policy with the map of the worst cell, and with all maps, by least squares on `learnt_from`."""
    policy, worst, seen = policies()["run"], failing_cells().argmax(), learnt_from()
    refitted, maps = refit(policy, seen.states, seen.actions), policy.coefficients.copy()
    maps[worst] = refitted.coefficients[worst]
    return {"run_worst_refitted": VoronoiPolicy(policy.codewords, maps, task=TASK), "run_refitted": refitted}


def about_run() -> dict[str, float | str]:
    """Return what the text says of the run: its size, its worst cell, a start there, and what it is refitted on."""
    (policy, history), worst = distilled(), int(failing_cells().argmax())
    cured = failing(policy) & ~failing(repaired()["run_worst_refitted"]) & (policy.cells(starts_of(TASK)) == worst)
    return {
        "run_cells": len(policy),
        "run_worst_cell": int(state_space.birth_colours(policy, history)[0][worst]),
        "run_worst_cell_failures": int(failing_cells()[worst]),
        "fails_at": ",".join(map(str, starts_of(TASK)[cured][0])),
        "refit_states": len(learnt_from().states),
    }


def about_spike() -> dict[str, int]:
    """Return the worst moment of the run after half of its iterations: failures before, then, and after how many
    iterations there are less than half as many."""
    stored = run()
    n, failures = np.array(stored["n"]), np.array(stored["failures"])
    at = int(np.where(n > n[-1] // 2, failures, 0).argmax())
    healed = next(i for i in range(at, len(n)) if failures[i] < failures[at] / 2)
    about = {"at": n[at], "before": failures[at - 1], "then": failures[at], "healed": n[healed] - n[at]}
    return {f"spike_{what}": int(value) for what, value in about.items()}


def from_tables() -> dict[str, float]:
    """Return numbers of committed tables: the best one map for the return, all reruns, and the proofs."""
    limit = read_results(f"limit_{TASK.name}")
    tuned = limit[limit["size"] == 1].sort_values("mean").iloc[-1]
    simpler = read_paper_results("simpler")
    simpler = simpler[simpler["task"] == TASK.name].set_index("policy")
    refitted, reruns = simpler.loc["same cells, least squares"], read_paper_results(TASK.name)
    same = reruns[reruns["seed"] < refitted["policies"]]  # those that were refitted
    numbers = {
        "episodes": measure.N_REPORTED,
        "tuned_one_map_failures": round(tuned["failing"] * measure.N_REPORTED),
        "reruns": len(same),
        "reruns_failing": float(1 - same["goal"].mean()),
        "reruns_refitted_failing": float(refitted["failing"]),
    }
    proved = read_results("proofs").set_index("name")
    for name in DIGITS:
        row = proved.loc[f"simplegoal_{name}"]
        numbers |= {f"proved_{name}": float(row["pit"] + row["left"])}
    return numbers


# The teacher's network, the run, and the episodes that it learnt from


@functools.cache
def run() -> dict:
    """Return the run at every change and every `History.every` iterations; the last moment is the final policy."""
    (policy, history), config = distilled(), vsp.preset(TASK.name)
    last = len(history.cells) - 1
    moments = sorted({*range(0, last, history.every), *(event.iteration for event in history.events), last})
    snapshots = [*(history.policy_at(n) for n in moments[:-1]), policy]
    codewords, before = [], np.zeros((0, 2))
    for i, each in enumerate(snapshots):
        if not np.array_equal(each.codewords, before):
            codewords.append([i, each.codewords.tolist()])  # rounded, ties of Manhattan distances end otherwise
        before = each.codewords
    events = [
        {"n": e.iteration, "kind": e.kind, "codeword": e.codeword.round(6).tolist(), "cause": e.cause}
        for e in history.events
    ]
    return {
        "n": moments,
        "cells": [len(each) for each in snapshots],
        "codewords": codewords,
        "coefficients": encoded([each.coefficients for each in snapshots]),
        "failures": [played(each)["failures"] for each in snapshots],
        "events": events,
        "config": dataclasses.asdict(config),
    }


def visited() -> dict:
    """Return states and actions of `learnt_from`."""
    return {name: encoded([getattr(learnt_from(), name)]) for name in ("states", "actions")}


# The proofs


@functools.cache
def proofs() -> dict:
    """Return the starts that surely fail, by policy: share, polygons, a square around them, a state inside."""
    return {name: failing_starts(f"simplegoal_{name}", digits) for name, digits in DIGITS.items()}


def failing_starts(name: str, digits: int) -> dict:
    """Return the failing starts that the certificate `name` proves.

    A certificate lists what the starts do step by step, not where they are. So the policy is followed once more, but
    only along what fails, and the exact areas must add up to what was proved: a tenth of a second, not twenty.
    """
    policy, content = load_certificate(name)
    regions = followed(policy, [line.split()[1:] for line in content["pieces"] if not line.startswith("goal")])
    share = total([region.area() for region in regions])
    if share != Fraction(content["claim"]["pit"]) + Fraction(content["claim"]["left"]):
        raise ValueError(f"{name}: the failing starts have the area {float(share)}, expected that of the claim")
    polygons = [[round(float(number), digits) for corner in each.points() for number in corner] for each in regions]
    corners = np.concatenate(polygons).reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, reach = (low + high) / 2, 0.9 * (high - low).max()
    box = [(middle - reach).round(digits).tolist(), (middle + reach).round(digits).tolist()]
    inside = np.reshape(polygons[0], (-1, 2)).mean(axis=0).round(digits).tolist()
    return {"share": float(share), "polygons": polygons, "box": box, "at": inside}


def cuts() -> list[list[tuple[int, list[tuple[float, float]]]]]:
    """Return how the square of starts is cut after 0, 1, ... steps of the policy with a margin: of each piece the cell
    of its last step and its corners."""
    pieces, stages = [Piece(SQUARE)], []
    for _ in range(N_CUTS + 1):
        stages.append([(each.steps[-1].cell if each.steps else 0, each.starts.points()) for each in pieces])
        loop = Loop(policies()["margin"])
        pieces = [after for piece in pieces for after in (loop.advance(piece) if piece.outcome == RUNNING else [piece])]
    return stages


def followed(policy: VoronoiPolicy, itineraries: list[list[str]]) -> list[Polygon]:
    """Return the starts whose steps are one of the `itineraries`, whole, in convex pieces."""
    whole = {tuple(steps) for steps in itineraries}
    begun = {steps[:n] for steps in whole for n in range(len(steps) + 1)}
    loop, running, found = Loop(policy), [Piece(SQUARE)], []
    while running:
        moved = [after for piece in running for after in loop.advance(piece)]
        found += [piece.starts for piece in moved if itinerary(piece) in whole and piece.outcome not in (GOAL, RUNNING)]
        running = [piece for piece in moved if itinerary(piece) in begun and piece.outcome == RUNNING]
    return found


def itinerary(piece: Piece) -> tuple[str, ...]:
    """Return the steps of a piece as a certificate writes them."""
    return tuple(f"{s.cell}{''.join(SIDES[side] for side in (*s.limits, *s.walls))}" for s in piece.steps)
