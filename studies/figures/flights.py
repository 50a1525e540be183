"""Draw a drone's flight as a film strip, and its linear map as what it does to thrust, roll, pitch and yaw."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from vsp.policy import VoronoiPolicy
from vsp_beyond.drone.flights import Command, fly
from vsp_beyond.drone.quadrotor import ARM, ATTITUDE, POSITION, rotation

APART, SIZE = 0.6, 5.0  # m between frames; how much larger a drone is drawn
TURN, RISE = np.deg2rad(25), np.deg2rad(12)  # from where one looks
CORNERS = ARM * np.array([[1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])  # of the motors
MIXES = {  # of the four commands: what all do, and what turns the body about x, y, z
    "thrust": (1, 1, 1, 1), "roll": (-1, -1, 1, 1), "pitch": (-1, 1, 1, -1), "yaw": (-1, 1, -1, 1),
}  # fmt: skip


def record_flight(command: Command, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the states (500, 149) and commands (500, 4) of one flight from `start` (21,)."""
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    fly(command, start[None], watch=lambda step, states, commands: seen.append((states[0].copy(), commands[0])))
    states, commands = map(np.array, zip(*seen))
    return states, commands


def film(ax: Axes, states: np.ndarray, moments: Sequence[float], *, step_seconds: float, color: str) -> None:
    """Draw the drone at `moments` (s) of its flight, `states` (t, 17 or more), side by side at its true height.

    Its front motors are drawn in `color`, the line upwards is the direction of its thrust."""
    for i, moment in enumerate(moments):
        state = states[round(moment / step_seconds)]
        turned = rotation(state[None, ATTITUDE])[0]
        middle = np.array([i * APART, state[POSITION][2]])
        corners = middle + seen(SIZE * CORNERS @ turned.T)
        for one, other in ((0, 2), (1, 3)):
            ax.plot(*corners[[one, other]].T, color="0.3", lw=1.2, solid_capstyle="round")
        ax.plot(*corners[[0, 3]].T, "o", color=color, ms=3)
        ax.plot(*corners[[1, 2]].T, "o", color="0.6", ms=3)
        ax.plot(*np.stack([middle, middle + seen(SIZE * 2 * ARM * turned[:, 2])]).T, color=color, lw=1)
    ax.axhline(0, color="0.8", lw=0.6, zorder=0)
    ax.set(xticks=APART * np.arange(len(moments)), xticklabels=[f"{moment:g}" for moment in moments])
    ax.set(ylabel="height (m)", aspect="equal", xlim=(-APART / 2, (len(moments) - 0.5) * APART))


def seen(points: np.ndarray) -> np.ndarray:
    """Return where points (..., 3) lie in the picture (..., 2): from the side, a little from above."""
    x, y, z = np.moveaxis(points, -1, 0)
    depth = x * np.sin(TURN) + y * np.cos(TURN)
    return np.stack([x * np.cos(TURN) - y * np.sin(TURN), z * np.cos(RISE) + depth * np.sin(RISE)], axis=-1)


def mixed(policy: VoronoiPolicy) -> pd.DataFrame:
    """Return the numbers of one map as what each input adds to thrust, roll, pitch and yaw, the `MIXES` of commands.

    What it remembers of the four motors is mixed likewise."""
    mixes = np.array(list(MIXES.values()))
    numbers = policy.coefficients[0] @ mixes.T / 4
    numbers[12:16] = mixes @ numbers[12:16]
    names = [*policy.task.input_labels[:12], *(f"remembered {name}" for name in MIXES), "bias"]
    return pd.DataFrame(numbers, index=pd.Index(names, name="input"), columns=list(MIXES))


def shares(ax: Axes, rows: pd.DataFrame, looks: dict[str, dict]) -> None:
    """Draw how often those in `looks` stay in the room, a line for each condition; bars are intervals of the gap."""
    names = list(rows["condition"].unique())[::-1]
    for i, (flies, look) in enumerate(looks.items()):
        mine = rows[rows["flies"] == flies].set_index("condition").loc[names]
        error = [mine["more"] - mine["more_low"], mine["more_high"] - mine["more"]]
        heights = np.arange(len(names)) + 0.22 * ((len(looks) - 1) / 2 - i)  # beside each other
        ax.errorbar(mine["kept"], heights, xerr=error, lw=1, ls="none", label=flies, **look)
    ax.set(yticks=range(len(names)), yticklabels=names, xlabel="share of flights that stay")
