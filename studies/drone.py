"""`make drone [AGENT=actor.h]`: linear maps of what flies, and how both fly: rows into data/beyond/.

Without AGENT it is our own teacher. With the file of the network that flew (`vsp_beyond.drone.flown`), only measured
rows come of it, with the file's checksum; no number of the file, and no map fitted to it, is kept.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.linalg import solve_discrete_are

from vsp import VoronoiPolicy
from vsp.evaluation import r_squared
from vsp.protocol import Job, job
from vsp.protocol.intervals import crossed_interval
from vsp.protocol.job import provenance
from vsp.run import command
from vsp.teachers.teacher import SHIPPED, load_teacher
from vsp_beyond.drone import flights, imitation
from vsp_beyond.drone.flights import BODIES, EASY, HARD, PUSH, command_of, fly, with_history
from vsp_beyond.drone.flown import Flown
from vsp_beyond.drone.quadrotor import CRAZYFLIE, HOVER, Body, Starts, advance, quadrotor

from .committed import RESULTS, read_results, write_results

N, START_SEED, PUSH_SEED = 300, 1000, 1001  # flights of each kind, from starts of their own
TEACHER = SHIPPED / "Quadrotor-v0.safetensors"
WAYS: dict[str, dict] = {
    "one map": {}, "four cells": {"n_cells": 4},
    "one map that only imitates": {"calm": False},
    "one map without past commands": {"calm": False, "memory": False},
}  # fmt: skip
SEEDS = {"network": range(1), "LQR": range(1)}
SEEDS |= {flies: range(10 if how.get("calm", True) else 3) for flies, how in WAYS.items()}
WHOLE = ("network", "LQR", "one map", "four cells")  # under all conditions; the others as built, from the easier starts
CONDITIONS = (*BODIES, "push of .5 m/s")
KINDS = ("kept", "distance", "change")


def own_teacher():
    """Return our own network of the 16 inputs."""
    return load_teacher(TEACHER, quadrotor())


def network(agent: str) -> tuple[flights.Command, str, int]:
    """Return how a network flies, its digest, and how many numbers it has: of the file `agent`, or ours with ""."""
    if agent:
        flown = Flown(agent)
        return flown.command, flown.digest, flown.numbers
    own = own_teacher()
    return command_of(own), own.digest, sum(part.size for layer in own.layers for part in layer)


def regulator() -> VoronoiPolicy:
    """Return the linear-quadratic regulator of the hovering drone: from the equations, without any network.

    It takes the remembered speeds for those of the motors. The weights are one of nine sets that were tried by hand, on
    other starts. With another mass it drifts slowly, because it sees a position only up to its limit."""
    here, steer, seen = imitation.loop_of(CRAZYFLIE)
    states = np.linalg.pinv(seen)  # (20, 16), from inputs
    states[12:16] = states[16:]
    ahead, push = seen @ here @ states, seen @ steer
    worth = solve_discrete_are(ahead, push, np.diag(np.repeat([1, 10, 1, 1, 0.1, 0], [3, 2, 1, 3, 3, 4])), np.eye(4))
    gain = np.linalg.solve(np.eye(4) + push.T @ worth @ push, push.T @ worth @ ahead)
    maps = np.vstack([-gain.T, HOVER * (1 + gain[:, 12:].sum(axis=1))])
    return VoronoiPolicy(np.zeros((1, 16)), maps[None], task=quadrotor())


@dataclass(frozen=True)
class Measured(Job):
    """The flights of a network, or of one map of a seed: under all conditions, or as built from the easier starts."""

    agent: str  # the file of the network that flew; "": ours
    flies: str
    seed: int
    kind = "Drone"
    task = "Quadrotor-v0"

    @property
    def provenance(self) -> dict[str, str | int]:
        """The network, and what decides the rest."""
        bodies = {name: vars(body) for name, body in BODIES.items()}
        flights_ = [N, START_SEED, PUSH_SEED, PUSH, [vars(starts) for starts in EASY + HARD], bodies]
        settings = {"flies": self.flies, "way": WAYS.get(self.flies), "flights": flights_, "conditions": CONDITIONS}
        return provenance(settings, network(self.agent)[1], imitation.VERSION)

    def make(self) -> tuple[dict, dict]:
        """Fit the map, and fly."""
        theirs, _, numbers = network(self.agent)
        if self.flies == "network":
            ours, r2 = theirs, 1.0
        else:
            ways = {"seed": self.seed, "progress": False} | WAYS.get(self.flies, {})
            policy = regulator() if self.flies == "LQR" else imitation.few_maps(theirs, **ways)
            numbers, ours = int(np.count_nonzero(policy.coefficients)), command_of(policy)
            numbers += policy.codewords.size * (len(policy) > 1)
            r2 = _r2(ours, theirs)
        loops = {name: radius_at_rest(ours, body) for name, body in BODIES.items()}
        radii = {name: radius if np.isfinite(radius) else None for name, radius in loops.items()}  # JSON has no NaN
        made = [_flights(ours, name, starts) for name, starts in conditions(self.flies)]
        arrays = {kind: np.stack([getattr(one, kind) for one in made]) for kind in KINDS}
        return arrays, {"numbers": numbers, "r2": r2, "radii": radii}


def radius_at_rest(ours: flights.Command, body: Body = CRAZYFLIE) -> float:
    """Return the largest absolute eigenvalue of the whole loop, a network's history included, where it comes to rest.

    By central differences; NaN if half a minute of flight from the origin does not end in rest."""
    states = with_history(Starts(0.0, 0.0, 0.0, 0.0)(np.random.default_rng(0), 1))
    for _ in range(3000):
        before, states = states, advance(states, ours(states), body)
    if np.abs(states - before).max() > 1e-6:
        return np.nan
    tiny = 1e-4 * np.eye(states.size)  # a network's float32 rounds smaller steps away
    after = [advance(states + way, ours(states + way), body) for way in (tiny, -tiny)]
    return float(np.abs(np.linalg.eigvals((after[0] - after[1]) / 2e-4)).max())


def conditions(flies: str) -> list[tuple[str, flights.Starts]]:
    """Return the conditions and the limits of starts under which something flies."""
    names, starts = (CONDITIONS, EASY + HARD) if flies in WHOLE else (CONDITIONS[:1], EASY)
    return [(name, one) for name in names for one in starts]


def _flights(ours: flights.Command, name: str, starts: flights.Starts) -> flights.Flights:
    pushes = np.random.default_rng(PUSH_SEED).normal(size=(N, 3))
    pushes *= PUSH / np.linalg.norm(pushes, axis=1, keepdims=True)
    begun = starts(np.random.default_rng(START_SEED), N)
    return fly(ours, begun, BODIES.get(name, CRAZYFLIE), pushes=None if name in BODIES else pushes)


def _r2(ours: flights.Command, theirs: flights.Command) -> float:
    """Return R² of the commands on flights of the network that stay in the room."""
    states: list[np.ndarray] = []
    flights_ = fly(theirs, EASY[1](np.random.default_rng(START_SEED), N), watch=lambda t, s, c: states.append(s))
    seen = np.concatenate([one[flights_.kept] for one in states[:: imitation.EVERY]])
    return r_squared(ours(seen), theirs(seen))


def rows(agent: str, folder: Path) -> list[dict]:
    """Return a row per what flies, condition and kind of start: means over maps and flights, and how much oftener than
    the network it stays, with an interval over maps *and* starts."""
    found, theirs = [], None
    for flies, seeds in SEEDS.items():
        work = [Measured(agent, flies, seed) for seed in seeds]
        loaded = [one.load(folder) for one in work]
        values = {kind: np.stack([arrays[kind] for arrays, _ in loaded]) for kind in KINDS}  # (seeds, conditions, n)
        theirs = values["kept"][0].astype(float) if theirs is None else theirs
        about = [about for _, about in loaded]
        for i, (condition, starts) in enumerate(conditions(flies)):
            more = values["kept"][:, i] - theirs[i]
            low, high = crossed_interval(more) if flies != "network" else (0.0, 0.0)
            radii = np.array([one["radii"].get(condition) for one in about], dtype=float)
            found.append({
                "agent": "flown" if agent else "own", "flies": flies, "condition": condition,
                "starts": "hard" if starts in HARD else "easy", "tilt": starts.tilt,
                "kept": values["kept"][:, i].mean(), "more": more.mean(), "more_low": low, "more_high": high,
                **{kind: pd.Series(values[kind][:, i].ravel()).mean() for kind in KINDS[1:]},  # without NaN
                "radius": radii.max(), "r2": np.mean([one["r2"] for one in about]),
                "numbers": about[0]["numbers"], "seeds": len(work), "checksum": network(agent)[1],
                **work[0].provenance,
            })  # fmt: skip
    return found


def current() -> list[dict]:
    """Return what rows are made with today; the flown network's file counts as it is there."""
    own = [Measured("", flies, 0).provenance for flies in SEEDS]
    rows = read_results("drone")
    teachers = rows["teacher"][rows["agent"] == "flown"].unique()
    return own + [one | {"teacher": teacher} for one in own for teacher in teachers]


def main() -> None:
    """Fly a network, maps of it and a regulator; write their rows to drone.csv."""
    parser = command.parser(main.__doc__, "results: OUT/data/beyond, files: OUT/build/drone")
    parser.add_argument("--agent", default="", help="the file of the network that flew, actor.h")
    given = parser.parse_args()
    folder = given.out / "build" / "drone"
    work = [Measured(given.agent, flies, seed) for flies, seeds in SEEDS.items() for seed in seeds]
    job.make_all(work, folder, "drones", jobs=given.jobs, unit="controllers")
    made = pd.DataFrame(rows(given.agent, folder))
    if (RESULTS / "drone.csv").exists():
        kept = read_results("drone")
        made = pd.concat([kept[~kept["agent"].isin(made["agent"])], made])
    write_results(made, "drone", out=given.out)


if __name__ == "__main__":
    with command.in_one_line():
        main()
