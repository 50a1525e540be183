"""Kills, full and closed disks, two makes at once, odd places, edited locks: `make faults`, hours.

After each fault, a re-run must end with the bytes of an undisturbed run. FAULTS=5 tries the first 5 of each row; the
50 kills of whole groups go on where an earlier call stopped, also one whose rows are committed. Both the reference and
what is done so far lie in build/faults, by the state of the code.
"""

import contextlib
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import makes
import numpy as np
import pandas as pd
import pytest
from makes import FIGURES, ROOT, Make, Reference, difference, figures, processes, tree, until

from vsp.run.listed import read_table
from vsp.run.locks import file_lock

PER_ROW = int(os.environ.get("FAULTS", 1000))  # at most so many of each row
WITHIN = 60  # seconds for make to notice a killed child
GONE = 30  # seconds for orphans to go
NAMESPACE = ("unshare", "--mount", "--map-root-user")


@pytest.fixture(scope="module")
def folder():
    path = ROOT / "build" / "faults" / makes.state_of_code()
    with file_lock(path / "lock", "breaks things here"):
        yield path


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


def test_kill_of_the_process_group(folder, reference, record, keep):
    """At a moment drawn from each fiftieth of the undisturbed run's time, in random order."""
    rng, state = np.random.default_rng(0), makes.state_of_machinery()
    shares = ((np.arange(50) + rng.uniform(size=50)) / 50)[rng.permutation(50)]
    note = folder / "kills.json"
    done = json.loads(note.read_text()) if note.exists() else committed(state)
    for share in map("{:.4f}".format, shares[:PER_ROW]):
        if share not in done:
            wrong, moment, again = killed_at(float(share) * reference.seconds, reference)
            about = {"share": share, "moment": moment, "again": again, "undisturbed": reference.seconds}
            done[share] = {**about, "wrong": wrong, "state": state}
            note.write_text(json.dumps(done, indent=2))
            print(f"killed after {moment:.0f} s: {wrong or 'held'}", file=sys.__stderr__, flush=True)
    keep("kills", pd.DataFrame(done.values()))
    wrong = {share: one["wrong"] for share, one in done.items() if one["wrong"]}
    tell(record, "SIGKILL of the process group, at random moments", wrong, len(done), of=50, note="same bytes")


def committed(state: str) -> dict[str, dict]:
    """The kills in data/results, where the code was as it is now: they may be another machine's, or another day's."""
    path = ROOT / "data" / "results" / "kills.csv"
    rows = read_table(path, dtype=str, keep_default_na=False).to_dict("records") if path.exists() else []
    numbers = ("moment", "again", "undisturbed")
    return {row["share"]: row | {name: float(row[name]) for name in numbers} for row in rows if row["state"] == state}


def killed_at(seconds: float, reference: Reference) -> tuple[str, float, float]:
    """What is wrong after a kill so many seconds after the start, empty if nothing; that moment; seconds of the re-run.

    Where make had ended by then, for it was quicker than the undisturbed one, the same again a tenth earlier.
    """
    out = reference.out
    shutil.rmtree(out, ignore_errors=True)
    make = figures(out)
    with contextlib.suppress(subprocess.TimeoutExpired):
        make.process.wait(seconds)
        return killed_at(0.9 * seconds, reference)
    orphans = processes(out)
    make.kill()
    killed = time.monotonic()
    wrong = wrong_after(out, reference, f"{out}-again.log")
    again = time.monotonic() - killed
    until(lambda: not orphans.keys() & processes(out).keys(), killed + GONE - time.monotonic())
    left = [f"still there: {command[:200]}" for pid, command in processes(out).items() if pid in orphans]
    return " ".join([wrong or difference(tree(out), reference.tree), *left]).strip(), seconds, again


def test_kill_of_a_kernel(folder, reference, record):
    rng, wrong, slowest = np.random.default_rng(1), {}, 0.0
    tried = min(10, PER_ROW)
    for _ in range(tried):
        name = str(rng.choice(list(reference.notebooks)))
        out = reference.again(without=reference.notebooks)  # others are under way when this one dies
        place = f"{out}/build/running/{name}-"  # its kernel's working folder is there
        moment = partial(rng.uniform, 0, 0.8 * reference.notebooks[name])
        when, took, said = kill_one(out, "ipykernel_launcher", moment, place=place)
        slowest = max(slowest, took)
        problems = [] if f"error: {name}.ipynb" in said and "did not end" in said else [f"says {said[-300:]}"]
        problems += [f"took {took:.0f} s"] if took > WITHIN else []
        if problems := [*problems, *filter(None, [wrong_after(out, reference, f"{out}-again.log")])]:
            wrong[f"{name} after {when:.1f} s"] = " ".join(problems)
    tell(record, "SIGKILL of a kernel", wrong, tried, of=10, note=f"make ended within {slowest:.0f} s")


def test_kill_of_a_worker(folder, reference, record):
    rng, wrong, slowest = np.random.default_rng(2), {}, 0.0
    tried = min(10, PER_ROW)
    for number in range(tried):
        out = reference.again(without=reference.notebooks)  # some are under way when it dies
        shutil.rmtree(out / "data" / "runs")
        when, took, said = kill_one(out, "loky.backend.popen_loky_posix", partial(rng.uniform, 0, 2.5), "JOBS=2")
        slowest = max(slowest, took)
        named = re.search(r"error: [^:\n]+: a worker process was killed.* \d of \d (runs|fits) done.*goes on", said)
        problems = [] if named else [f"says {said[-300:]}"]
        problems += [f"took {took:.0f} s"] if took > WITHIN else []
        if problems := [*problems, *filter(None, [wrong_after(out, reference, f"{out}-again.log")])]:
            wrong[f"number {number}, after {when:.1f} s"] = " ".join(problems)
    tell(record, "SIGKILL of a pool worker", wrong, tried, of=10, note=f"make ended within {slowest:.0f} s")


def kill_one(out: Path, what: str, moment, *more, place=None) -> tuple[float, float, str]:
    """Kill a process at `place`, else `out`, whose command line has `what`.

    Returns when after its start, how long make then took, and what it said. Where the process has ended before, it was
    too late: the same again at another moment.
    """
    before = tree(out)
    for _ in range(10):
        make, when = Make(*FIGURES, *more, f"OUT={out}", log=f"{out}.log"), moment()
        mine = partial(_with, place or out, what)
        until(lambda mine=mine, make=make: mine() or make.process.poll() is not None, 120)
        time.sleep(when)
        there = mine()
        if there and make.process.poll() is None:
            os.kill(there[0], signal.SIGKILL)
            killed = time.monotonic()
            if make.wait(WITHIN * 5) != 0:
                return when, time.monotonic() - killed, make.said
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
    """The files in `out` after some of one notebook were made to differ from what make would make."""
    for name in ("executed/02_distillation.ipynb", "voronoi_example.pdf", "partition_growth.png"):
        path = out / "figures" / name
        path.write_bytes(path.read_bytes() + b"\n")
    return tree(out)


def refused(make: Make, *words: str) -> str:
    """What is wrong with the way in which `make` failed, in words; empty if nothing."""
    status, lines = make.wait(), make.said.splitlines()
    problems = [] if status else ["it ends with 0"]
    problems += [f"{word!r} is not said: {make.said[-600:]}" for word in words if word not in make.said]
    return " ".join([*problems, *([f"{len(lines)} lines"] if len(lines) > 20 else [])])


@pytest.mark.parametrize(("room", "of"), [(0, "notebooks"), (20, "notebooks"), (200, "notebooks"), (1500, "notebooks"),
                                          (0, "runs"), (200, "runs")])  # fmt: skip
def test_full_disk(folder, reference, record, room, of):
    """`room` in kB. Where runs are to be made, whole ones may have joined what was there before."""
    out, disk, after = reference.again(), folder / "disk", folder / "after"
    if of == "runs":
        shutil.rmtree(out / "data" / "runs")
    before = outdated(out)
    shutil.rmtree(after, ignore_errors=True)
    disk.mkdir(exist_ok=True)
    make = figures(disk, before=mounting(FULL, out, disk, after, room))
    wrong, found = refused(make, "No space left on device", "free some space"), tree(after)
    whole = {name for name in found.keys() - before.keys() if found[name] == reference.tree.get(name)}
    wrong = wrong or difference(before, {name: found[name] for name in found.keys() - whole})
    check(record, f"full disk, {room} kB left for {of}", wrong, "clear error, outputs untouched")


@pytest.mark.parametrize("how", ["mounted", "immutable", "by rights"])
def test_read_only_figures(folder, reference, record, how):
    out = reference.again()
    before, words = outdated(out), ("figures", "make it writable", "OUT=folder")
    if how == "by rights" and os.geteuid() == 0:
        pytest.skip("root writes anywhere")
    if how == "mounted":
        wrong = refused(figures(out, before=mounting(CLOSED, out / "figures")), *words)
    else:
        close, unclose = {"immutable": ("chattr +i", "chattr -i"), "by rights": ("chmod a-w", "chmod u+w")}[how]
        places = [out / "figures", out / "figures" / "tables", out / "figures" / "executed"]
        if subprocess.run([*close.split(), *places]).returncode:
            pytest.skip(f"{close} does not work here")
        try:
            wrong = refused(figures(out), *words)
        finally:
            subprocess.run([*unclose.split(), *places], check=True)
    wrong = wrong or difference(before, tree(out)) or wrong_after(out, reference, f"{out}-again.log")
    check(record, f"read-only figures/, {how}", wrong, "clear error, outputs untouched")


@pytest.mark.parametrize("limit", [10, 60, 250])  # kB
def test_limit_on_the_size_of_files(folder, reference, record, limit):
    out = reference.again()
    before = outdated(out)
    small = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (1000 * limit, 1000 * limit))
    wrong = refused(figures(out, preexec_fn=small), "File too large", "ulimit -f")
    wrong = wrong or difference(before, tree(out)) or wrong_after(out, reference, f"{out}-again.log")
    check(record, f"files of at most {limit} kB", wrong, "clear error, outputs untouched")


# Two at once


def test_two_makes_at_once(folder, reference, record):
    """Mostly with one notebook to run; the last two of twenty from nothing."""
    rng, wrong, waited = np.random.default_rng(3), {}, 0
    for number in range(tried := min(20, PER_ROW)):
        if number < 18:
            name = str(rng.choice(list(reference.notebooks)))
            out, longest = reference.again(without=[name]), reference.notebooks[name] + 3
        else:
            name, out, longest = "all", reference.out, reference.seconds
            shutil.rmtree(out)
        first = figures(out)
        time.sleep(rng.uniform(0, longest))
        second = figures(out, f"{out}-second.log")
        statuses = [make.wait(300 + 5 * reference.seconds) for make in (first, second)]
        waited += "waiting for it to end" in first.said + second.said
        problems = [f"ends with {statuses}: {first.said[-300:]} {second.said[-300:]}"] if any(statuses) else []
        problems += [difference(tree(out), reference.tree) or wrong_after(out, reference, f"{out}-again.log")]
        if any(problems):
            wrong[f"{number}, {name}"] = " ".join(problems)
    note = f"{waited} times one waited for the other"
    tell(record, "two makes at once, results as serial", wrong, tried, of=20, note=note)


def test_two_courses_at_once(folder, record):
    def files(out):
        course = out / "build" / "course"
        return {p.relative_to(course): p.read_bytes() for p in course.rglob("*") if p.is_file()}

    places = [folder / f"course-{n}" for n in range(1 + min(5, PER_ROW))]
    for place in places:
        shutil.rmtree(place, ignore_errors=True)
    assert Make("course", f"OUT={places[0]}", log=f"{places[0]}.log").wait() == 0
    wrong = {}
    for number, out in enumerate(places[1:]):
        two = [Make("course", f"OUT={out}", log=f"{out}-{n}.log") for n in range(2)]
        if any(make.wait() for make in two) or files(out) != files(places[0]):
            wrong[str(number)] = " ".join(make.said[-300:] for make in two)
    tell(record, "two makes of the course at once", wrong, len(places) - 1, of=5)


# Odd places


@pytest.fixture(scope="module")
def elsewhere(folder):
    """A copy of the checkout in a folder with a space and letters beyond ASCII."""
    place = folder / "größe und äpfel" / "vsp"
    shutil.rmtree(place.parent, ignore_errors=True)
    makes.copy_checkout(place)
    makes.lend_environment(place)
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


def of(name: str, lock: str) -> str:
    """The lines of `lock` for the package `name`."""
    return re.search(rf"^{name}==.*\n( .*\n)*", lock, re.M)[0]


EDITS = {
    "a wrong checksum": (lambda six: re.sub("sha256:....", "sha256:beef", six), "six", "THESE PACKAGES DO NOT MATCH"),
    "no such version": (lambda six: re.sub("==[0-9.]*", "==99.0", six, count=1), "six", "six==99.0"),
    "a package removed": (lambda six: "", "six", "requires six, which is not installed"),
    "a wrong checksum of torch": (
        lambda torch: re.sub("sha256:....", "sha256:beef", torch),
        "torch",
        "SHA-256 of torch",
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edited_lock(elsewhere, record, edit):
    change, name, said = EDITS[edit]
    lock = (ROOT / "environment.lock").read_text()
    (elsewhere / "environment.lock").write_text(lock.replace(of(name, lock), change(of(name, lock))))
    make = Make("venv-train", log=elsewhere.parent / "edited.log", cwd=elsewhere)
    wrong = refused(make, said, "error: .venv is not whole", "was environment.lock edited?")
    parts = elsewhere / ".venv" / "parts"
    wrong += " taken for whole" * (parts.exists() and "train" in parts.read_text())
    (elsewhere / "environment.lock").write_text(lock)
    check(record, f"lock edited: {edit}", wrong, "clear error with a remedy")


def test_killed_set_up(elsewhere, record):
    """The next make is not blocked and begins anew; two of them at once: one waits for the other."""
    rng, wrong = np.random.default_rng(4), {}
    for _ in range(tried := min(3, PER_ROW)):
        shutil.rmtree(elsewhere / ".venv", ignore_errors=True)
        make = Make("venv-train", log=elsewhere.parent / "killed.log", cwd=elsewhere)
        time.sleep(when := rng.uniform(1, 30))
        make.kill()
        two = [Make("venv-train", log=elsewhere.parent / f"venv-{n}.log", cwd=elsewhere) for n in range(2)]
        statuses, said = [make.wait() for make in two], "".join(make.said for make in two)
        whole = Make("venv-train", log=elsewhere.parent / "whole.log", cwd=elsewhere)
        if any(statuses) or said.count("Setting up") != 1 or "waiting for it" not in said or whole.wait() or whole.said:
            wrong[f"after {when:.0f} s"] = f"{statuses} {said[-500:]} {whole.said}"
    tell(record, "set-up killed, then two set-ups at once", wrong, tried, of=3)
