"""`make` from outside: started, killed, looked at. What the tests of faults share."""

import atexit
import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ("all", "QUICK=1")


class Make:
    """A `make` in a session of its own; all that it says goes to one file, which no orphan can keep open for long."""

    def __init__(self, *goals, log, cwd=ROOT, before=(), env=None, **options):
        self.log, self.began = Path(log), time.monotonic()
        self.log.parent.mkdir(parents=True, exist_ok=True)
        of_make = ("MAKE", "MFLAGS", "OUT", "JOBS", "QUICK", "PYTHON", "DASK")  # of the make that runs the tests
        environ = {name: value for name, value in os.environ.items() if not name.startswith(of_make)} | (env or {})
        with open(log, "wb") as file:
            self.process = subprocess.Popen(
                [*before, "make", *goals], cwd=cwd, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                start_new_session=True, env=environ, **options,
            )  # fmt: skip
        atexit.register(self.kill)

    def wait(self, limit=900) -> int:
        """The exit status. A hang is a failure: all is killed and TimeoutExpired raised."""
        try:
            return self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.kill()
            raise

    def kill(self) -> None:
        """SIGKILL to the whole process group."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    @property
    def said(self) -> str:
        return self.log.read_text(encoding="utf-8", errors="replace")


def figures(out, log=None, **options) -> Make:
    """`make all QUICK=1` into the folder `out`."""
    return Make(*FIGURES, f"OUT={out}", log=log or f"{out}.log", **options)


def tree(out) -> dict[str, str]:
    """The checksum of every file below figures/ and data/: leftovers count."""
    files = (path for part in ("figures", "data") for path in Path(out, part).rglob("*") if path.is_file())
    return {path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def difference(one: dict, other: dict) -> str:
    """The names in which two trees differ; empty if none."""
    return " ".join(sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name)))


def processes(word) -> dict[int, str]:
    """Command lines of all processes but this one whose command line, folder or environment holds `word`, by id."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            command = (folder / "cmdline").read_bytes()
            text = command + os.fsencode(os.readlink(folder / "cwd")) + (folder / "environ").read_bytes()
        except OSError:  # it has just ended
            continue
        if command and os.fsencode(str(word)) in text and int(folder.name) != os.getpid():
            found[int(folder.name)] = command.replace(b"\0", b" ").decode(errors="replace")
    return found


def until(condition, limit=60):
    """What `condition` returns as soon as that is true, or its last value after `limit` seconds."""
    end = time.monotonic() + limit
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return value


def state_of_code() -> str:
    """Ten hexadecimal digits for all tracked files that decide the outputs, so that no result outlives its code."""
    paths = [*ROOT.glob("vsp/**/*.py"), *ROOT.glob("notebooks/*.ipynb"), *ROOT.glob("data/[pt]*/**/MANIFEST.sha256")]
    paths += [ROOT / "Makefile", ROOT / "environment.lock"]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(paths))).hexdigest()[:10]


def state_of_machinery() -> str:
    """Ten hexadecimal digits for what decides what a kill leaves behind and what the next make does with it."""
    paths = [ROOT / "Makefile", ROOT / "environment.sh", ROOT / "environment.lock", *sorted(ROOT.glob("vsp/run/*.py"))]
    paths += [ROOT / "vsp" / "paper" / name for name in ("make_runs.py", "runs.py")]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:10]


class Reference:
    """An undisturbed run: its files, how long it took, and how long each notebook did (seconds).

    It is made in the folder `out`, where all faults happen later: what make notes of it names its place.
    """

    def __init__(self, folder: Path):
        self.out, self.kept, self.note = folder / "out", folder / "reference", folder / "reference.json"
        shown = hashlib.sha256((ROOT / "data" / "results" / "MANIFEST.sha256").read_bytes()).hexdigest()
        if not self.note.exists() or json.loads(self.note.read_text())["shown"] != shown:
            for left in (self.out, self.kept):
                shutil.rmtree(left, ignore_errors=True)
            make = figures(self.out)
            assert make.wait() == 0, make.said
            self.out.rename(self.kept)
            seconds = time.monotonic() - make.began
            took = {name: int(s) for name, s in re.findall(r"^(\w+)\.ipynb: done in (\d+) s", make.said, re.M)}
            self.note.write_text(json.dumps({"seconds": seconds, "notebooks": took, "shown": shown}))
        noted = json.loads(self.note.read_text())
        self.seconds, self.notebooks, self.tree = noted["seconds"], noted["notebooks"], tree(self.kept)

    def again(self, *, without=()) -> Path:
        """`out` as it was then; the notebooks `without` must run anew: their copies are missing."""
        shutil.rmtree(self.out, ignore_errors=True)
        shutil.copytree(self.kept, self.out)
        for name in without:
            (self.out / "figures" / "executed" / f"{name}.ipynb").unlink()
        return self.out


def lend_environment(checkout: Path) -> None:
    """A .venv for a copy of the checkout: links to the files of ours, in a minute less than a new one takes."""
    ours, theirs = ROOT / ".venv", checkout / ".venv"
    packages = next(ours.glob("lib/python3*/site-packages"))
    for folder in (ours, ours / "bin", packages):
        there = theirs / folder.relative_to(ours)
        there.mkdir(parents=True, exist_ok=True)
        for path in folder.iterdir():
            if path.name not in ("bin", "lib", "lib64", "note", "parts", "packages"):
                (there / path.name).symlink_to(
                    os.readlink(path) if path.name.startswith("python") and path.is_symlink() else path
                )
    for name in ("parts", "packages"):
        shutil.copy(ours / name, theirs / name)
    lock, _, *python = (ours / "note").read_text(encoding="utf-8").splitlines(keepends=True)
    (theirs / "note").write_text("".join([lock, f"{checkout.resolve()}\n", *python]), encoding="utf-8")


def copy_checkout(folder: Path) -> Path:
    """All that git tracks, in `folder`."""
    names = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT).decode().split("\0")
    for name in filter(None, names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder
