"""Kills, full and closed disks, odd places, edited locks: `make faults`, hours.

After each fault, a re-run must end with the bytes of an undisturbed run. FAULTS=5 tries the first 5 of each row. The
reference and the 50 kills of whole groups that were tried lie in build/faults, by the state of the code.
"""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import makes
import numpy as np
import pytest
from makes import FIGURES, ROOT, Make, Reference, difference, figures, processes, tree, until

PER_ROW = int(os.environ.get("FAULTS", 1000))  # at most so many of each row
GONE = 30  # seconds for orphans to go
NAMESPACE = ("unshare", "--mount", "--map-root-user")


@pytest.fixture(scope="module")
def folder():
    return ROOT / "build" / "faults" / makes.state_of_code()


@pytest.fixture(scope="module")
def reference(folder):
    return Reference(folder)


def wrong_after(out, reference, log, *, env=None) -> str:
    """What is wrong after one more `make paper-figures`, in words; empty if nothing."""
    make = figures(out, log, env=env)
    try:
        status = make.wait(300 + 5 * reference.seconds)
    except subprocess.TimeoutExpired:
        return "the re-run hangs"
    if status:
        return f"the re-run ends with {status}: {make.said[-500:]}"
    return difference(tree(out), reference.tree)


def tell(record, what: str, wrong: dict[str, str], tried: int, *, of: int, note: str = "") -> None:
    """Record a row of several trials: how many passed, and what went wrong in the others."""
    note = "; ".join(filter(None, (note, *(f"{name}: {why}" for name, why in wrong.items()))))
    why = "" if wrong or tried >= of else "more are still to be tried"
    record("faults", what, tried - len(wrong), f"of {of}", at_least=of, note=note, why=why)


def check(record, what: str, wrong: str, expected: str) -> None:
    """Record a row of one trial."""
    record("faults", what, int(not wrong), "of 1", at_least=1, note=wrong or expected)


# Kills


def test_kill_of_the_process_group(folder, reference, record):
    """At a moment drawn from each fiftieth of the undisturbed run's time, in random order."""
    rng = np.random.default_rng(0)
    shares = ((np.arange(50) + rng.uniform(size=50)) / 50)[rng.permutation(50)]
    note = folder / "kills.json"
    tried = json.loads(note.read_text()) if note.exists() else {}
    for share in map("{:.4f}".format, shares[:PER_ROW]):
        if share not in tried:
            tried[share] = wrong_after_a_kill(float(share) * reference.seconds, reference)
            note.write_text(json.dumps(tried, indent=2))
            print(f"killed at {share}: {tried[share] or 'same bytes'}", file=sys.__stderr__, flush=True)
    wrong = {share: why for share, why in tried.items() if why}
    tell(record, "SIGKILL of the process group, at random moments", wrong, len(tried), of=50, note="same bytes")


def wrong_after_a_kill(seconds: float, reference: Reference) -> str:
    """What is wrong after a kill so many seconds after the start, in words; empty if nothing.

    Where make had ended by then, for it was quicker than the undisturbed one, the same again a tenth earlier.
    """
    out = reference.out
    shutil.rmtree(out, ignore_errors=True)
    make = figures(out)
    with contextlib.suppress(subprocess.TimeoutExpired):
        make.process.wait(seconds)
        return wrong_after_a_kill(0.9 * seconds, reference)
    orphans = processes(out)
    make.kill()
    killed = time.monotonic()
    wrong = wrong_after(out, reference, f"{out}-again.log")
    until(lambda: not orphans.keys() & processes(out).keys(), killed + GONE - time.monotonic())
    left = [f"still there: {command[:200]}" for pid, command in processes(out).items() if pid in orphans]
    return " ".join([wrong or difference(tree(out), reference.tree), *left]).strip()


def test_kill_of_a_kernel(reference, record):
    rng, wrong = np.random.default_rng(1), {}
    for _ in range(tried := min(10, PER_ROW)):
        name = str(rng.choice(list(reference.notebooks)))
        out = reference.again(without=reference.notebooks)  # others are under way when this one dies
        place = f"{out}/build/running/{name}/"  # its kernel's working folder is there
        moment = partial(rng.uniform, 0, 0.8 * reference.notebooks[name])
        said = kill_one(out, "ipykernel_launcher", moment, place=place)
        wrong |= unless_named(rf"error: {name}\.ipynb.*did not end", said, out, reference)
    tell(record, "SIGKILL of a kernel", wrong, tried, of=10)


def test_kill_of_a_worker(reference, record):
    rng, wrong = np.random.default_rng(2), {}
    for _ in range(tried := min(10, PER_ROW)):
        out = reference.again(without=reference.notebooks)  # some are under way when it dies
        shutil.rmtree(out / "data" / "runs")
        said = kill_one(out, "loky.backend.popen_loky_posix", partial(rng.uniform, 0, 2.5), "JOBS=2")
        named = r"error: [^:\n]+: a worker process was killed.* \d of \d (runs|fits) done.*to resume"
        wrong |= unless_named(named, said, out, reference)
    tell(record, "SIGKILL of a pool worker", wrong, tried, of=10)


def unless_named(fault: str, said: str, out: Path, reference: Reference) -> dict[str, str]:
    """What is wrong with what make said, and else with the next make, by time; empty if nothing."""
    why = wrong_after(out, reference, f"{out}-again.log") if re.search(fault, said) else f"says {said[-300:]}"
    return {time.strftime("%X"): why} if why else {}


def kill_one(out: Path, what: str, moment, *more, place=None) -> str:
    """What make says after a kill of a process at `place`, else `out`, whose command line has `what`.

    Where the process has ended before, it was too late: the same again at another moment.
    """
    before = tree(out)
    for _ in range(10):
        make = Make(*FIGURES, *more, f"OUT={out}", log=f"{out}.log")
        mine = partial(_with, place or out, what)
        until(lambda mine=mine, make=make: mine() or make.process.poll() is not None, 120)
        time.sleep(moment())
        there = mine()
        if there and make.process.poll() is None:
            os.kill(there[0], signal.SIGKILL)
            if make.wait() != 0:
                return make.said
        make.wait()
        for name in tree(out).keys() - before.keys():  # as it was
            (out / name).unlink()
    raise AssertionError(f"no {what} could be killed in time: {make.said}")


def _with(place, what: str) -> list[int]:
    return [pid for pid, command in processes(place).items() if what in command]


# Disks

# The folder $1 read-only for the command that follows
CLOSED = """
  set -e; closed=$1; shift
  mount --bind "$closed" "$closed"; mount -o remount,ro,bind "$closed"
  if touch "$closed/x" 2>/dev/null; then exit 9; fi
  cd "$PWD"; "$@" """  # anew, to come into the mounted folder
FULL = """
  set -e; out=$1; disk=$2; after=$3; room=$4; shift 4
  mount -t tmpfs -o size=500m tmpfs "$disk"; cp -a "$out/." "$disk"
  used=$(df --output=used "$disk" | tail -n 1); mount -o remount,size=$((used + room))k "$disk"
  status=0; "$@" || status=$?; mkdir "$after"; cp -a "$disk/figures" "$disk/data" "$after"; exit $status"""


def mounting(script: str, *arguments) -> tuple:
    """What runs a command behind `script`, whose mounts go with its process. Skips where nothing may be mounted."""
    if subprocess.run([*NAMESPACE, "mount", "-t", "tmpfs", "tmpfs", "/mnt"], capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    return (*NAMESPACE, "sh", "-c", script, "-", *map(str, arguments))


def outdated(out: Path) -> dict[str, str]:
    """The files in `out` after one notebook has to run again, and some of its files would change."""
    (out / "figures" / "executed" / "02_distillation.ipynb").unlink()
    for name in ("voronoi_example.pdf", "partition_growth.png"):
        path = out / "figures" / name
        path.write_bytes(path.read_bytes() + b"\n")
    return tree(out)


def refused(make: Make, *words: str) -> str:
    """What is wrong with the way in which `make` failed, in words; empty if nothing."""
    status, lines = make.wait(), make.said.splitlines()
    problems = [] if status else ["it ends with 0"]
    problems += [f"{word!r} is not said: {make.said[-600:]}" for word in words if word not in make.said]
    return " ".join([*problems, *([f"{len(lines)} lines"] if len(lines) > 20 else [])])


@pytest.mark.parametrize(("room", "of"), [(20, "notebooks"), (1500, "notebooks"), (200, "runs")])
def test_full_disk(folder, reference, record, room, of):
    """`room` in kB. Where runs are to be made, whole ones may have joined what was there before."""
    out, disk, after = reference.again(), folder / "disk", folder / "after"
    if of == "runs":
        shutil.rmtree(out / "data" / "runs")
    before = outdated(out)
    shutil.rmtree(after, ignore_errors=True)
    disk.mkdir(exist_ok=True)
    make = figures(disk, before=mounting(FULL, out, disk, after, room))
    wrong, found = refused(make, "No space left on device"), tree(after)
    whole = {name for name in found.keys() - before.keys() if found[name] == reference.tree.get(name)}
    wrong = wrong or difference(before, {name: found[name] for name in found.keys() - whole})
    check(record, f"full disk, {room} kB left for {of}", wrong, "clear error, outputs untouched")


def test_read_only_figures(reference, record):
    out = reference.again()
    before = outdated(out)
    make = figures(out, before=mounting(CLOSED, out / "figures"))
    wrong = refused(make, "figures", "make it writable", "OUT=folder")
    wrong = wrong or difference(before, tree(out)) or wrong_after(out, reference, f"{out}-again.log")
    check(record, "read-only figures/, mounted", wrong, "clear error, outputs untouched")


# Odd places


@pytest.fixture(scope="module")
def elsewhere(folder):
    """A clone in a folder with a space and letters beyond ASCII, without a .venv."""
    place = folder / "größe und äpfel" / "vsp"
    shutil.rmtree(place.parent, ignore_errors=True)
    subprocess.run(["git", "clone", "-q", ROOT, place], check=True)
    return place


def test_spaces_and_letters_beyond_ascii(elsewhere, reference, record):
    out = elsewhere.parent / "aus gäbe"
    make = figures(out, elsewhere.parent / "log", cwd=elsewhere, env={"LC_ALL": "C"})
    wrong = difference(tree(out), reference.tree) if make.wait() == 0 else make.said[-500:]
    check(record, "checkout and OUT with spaces and non-ASCII letters", wrong, "same bytes")


def test_read_only_checkout(tmp_path, reference, record):
    """Nor is there a home."""
    out = tmp_path / "out"
    make = figures(out, before=mounting(CLOSED, ROOT), env={"HOME": f"{ROOT}/nobody"})
    wrong = difference(tree(out), reference.tree) if make.wait() == 0 else make.said[-500:]
    check(record, "read-only checkout, outputs elsewhere", wrong, "same bytes")


# Set-up with the real pip; tests/run/test_makefile.py has what needs no packages
