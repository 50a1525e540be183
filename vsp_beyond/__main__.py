"""`python -m vsp_beyond agent.zip MountainCarContinuous-v0`: from the file of an agent to a page that can be sent."""

import argparse
import sys
import time
import warnings
from pathlib import Path

import gymnasium

import vsp
from vsp.run import atomic
from vsp.run.progress import shown

from .few_cells.fewest import SIZES, TimeUp, fewest
from .names import named
from .page import report

MOST_SAID = 500  # characters of an error
PAGE_SECONDS = 10  # kept for the page and its proof, at most a third of all
END_SECONDS = 5  # kept for what follows the proof, also on a busy machine


def main() -> None:
    """Distil an agent to as few cells as act like it, and write one page about both: equations, episodes, returns."""
    begun = time.monotonic() - time.process_time()  # importing takes seconds, too
    parser = argparse.ArgumentParser(prog="python -m vsp_beyond", description=main.__doc__)
    parser.add_argument("agent", help="a zip of Stable-Baselines3 or sb3-contrib, or the name of a shipped teacher")
    parser.add_argument("task", help="a task of vsp or of Gymnasium's registry, also as module:Name-v0")
    parser.add_argument("--normalize", help="the file of VecNormalize, or no: observations were not normalised")
    parser.add_argument("--names", help='a JSON file that names the task\'s {"inputs": [...], "outputs": [...]}')
    parser.add_argument("--cells", type=int, help="the number of cells; without it, the fewest that act alike")
    parser.add_argument("--minutes", type=float, default=5, help="for all (%(default)s); a longer call goes on")
    parser.add_argument("--seed", type=int, default=0, help="of the distillation (%(default)s)")
    parser.add_argument("--out", type=Path, default="report.html", help="the page (%(default)s)")
    parser.add_argument("--force", action="store_true", help="write over a page that exists")
    given = parser.parse_args()
    try:
        if given.out.exists() and not given.force:
            raise FileExistsError(f"{given.out} exists and is kept: name another file, or say --force")
        if not 0 < given.minutes <= 1e6:
            raise ValueError(f"--minutes is {given.minutes:g}, expected a number above 0")
        atomic.begin(given.out).unlink()  # what would stop the page at the end stops it now
        task, until = named(vsp.get_task(given.task), given.names), begun + 60 * given.minutes - END_SECONDS
        with warnings.catch_warnings(record=True) as said, shown():
            warnings.simplefilter("always", UserWarning)
            agent = vsp.agent(given.agent, task, normalize=False if given.normalize == "no" else given.normalize)
            chosen, tried, left = fewest(
                agent, task, seed=given.seed, folder=given.out.with_suffix(".parts"),
                until=until - min(PAGE_SECONDS, 20 * given.minutes),
                sizes=SIZES if given.cells is None else [given.cells],
            )  # fmt: skip
        remarks = list(dict.fromkeys(str(one.message) for one in said if issubclass(one.category, UserWarning)))
        if left:
            remarks.append(f"Left out, because the time was over: {', '.join(left)}. With more --minutes it goes on.")
        name = Path(given.agent).name
        page = report(chosen.policy, agent, task, name=name, remarks="\n".join(remarks), tried=tried, until=until)
        atomic.write_text(given.out, page)
    except (ValueError, OSError, gymnasium.error.Error, ImportError, KeyboardInterrupt, TimeUp) as error:
        line = (
            (str(error) or "interrupted, nothing is written")
            .splitlines()[0][:MOST_SAID]
            .replace('normalize="vecnormalize.pkl"', "--normalize vecnormalize.pkl")
        )
        sys.stderr.write(f"error: {line.replace('normalize=False', '--normalize no')}\n")
        sys.exit(2)
    print(*remarks, chosen.alike, f"{given.out}: {len(page) / 1e6:.1f} MB; open it in a browser", sep="\n")


if __name__ == "__main__":
    main()
