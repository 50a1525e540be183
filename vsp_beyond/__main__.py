"""`python -m vsp_beyond agent.zip MountainCarContinuous-v0`: from the file of an agent to a page that can be sent."""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

import gymnasium

import vsp
from vsp.run import atomic

from . import faithful
from .page import report

MOST_SAID = 500  # characters of an error


def main() -> None:
    """Distil an agent to few cells that act like it, and write one page about both: equations, explorer, returns."""
    parser = argparse.ArgumentParser(prog="python -m vsp_beyond", description=main.__doc__)
    parser.add_argument("agent", help="a zip of Stable-Baselines3 or sb3-contrib, or the name of a shipped teacher")
    parser.add_argument("task", help="a task of vsp or of Gymnasium's registry, also as module:Name-v0")
    parser.add_argument("--normalize", help="the file of VecNormalize, or no: observations were not normalised")
    parser.add_argument("--cells", type=int, default=8, help="the largest number of cells (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the distillation (%(default)s)")
    parser.add_argument("--out", type=Path, default="report.html", help="the page (%(default)s)")
    parser.add_argument("--force", action="store_true", help="write over a page that exists")
    given = parser.parse_args()
    try:
        if given.out.exists() and not given.force:
            raise FileExistsError(f"{given.out} exists and is kept: name another file, or say --force")
        atomic.begin(given.out).unlink()  # what would stop the page at the end stops it now
        task = vsp.get_task(given.task)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", UserWarning)
            agent = vsp.agent(given.agent, task, normalize=False if given.normalize == "no" else given.normalize)
            policy = faithful(agent, task, n_cells=given.cells, seed=given.seed)
        remarks = "\n".join(str(one.message) for one in said if issubclass(one.category, UserWarning))
        page = report(policy, agent, task, name=Path(given.agent).name, remarks=remarks)
        atomic.write_text(given.out, page)
    except (ValueError, OSError, gymnasium.error.Error, ImportError, KeyboardInterrupt) as error:
        line = (
            (str(error) or "interrupted, nothing is written")
            .splitlines()[0][:MOST_SAID]
            .replace('normalize="vecnormalize.pkl"', "--normalize vecnormalize.pkl")
        )
        sys.stderr.write(f"error: {line.replace('normalize=False', '--normalize no')}\n")
        sys.exit(2)
    print(f"{given.out}: {len(page) / 1e6:.1f} MB; open it in a browser")


if __name__ == "__main__":
    main()
