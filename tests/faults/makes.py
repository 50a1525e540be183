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
    parts = ("vsp", "vsp_beyond", "studies")
    paths = [*(path for part in parts for path in ROOT.glob(f"{part}/**/*.py")), *ROOT.glob("notebooks/*.*")]
    paths += [*ROOT.glob("data/**/MANIFEST.sha256"), ROOT / "Makefile", ROOT / "environment.lock"]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(paths))).hexdigest()[:10]


class Reference:
    """An undisturbed run: its files, how long it took, and how long each notebook did (seconds).

    It is made in the folder `out`, where all faults happen later: what make notes of it names its place.
    """

    def __init__(self, folder: Path):
        self.out, self.kept, self.note = folder / "out", folder / "reference", folder / "reference.json"
        if not self.note.exists():
            for left in (self.out, self.kept):
                shutil.rmtree(left, ignore_errors=True)
            make = figures(self.out)
            assert make.wait() == 0, make.said
            self.out.rename(self.kept)
            seconds = time.monotonic() - make.began
            took = {name: int(s) for name, s in re.findall(r"^(\w+)\.ipynb: done in (\d+) s", make.said, re.M)}
            self.note.write_text(json.dumps({"seconds": seconds, "notebooks": took}))
        noted = json.loads(self.note.read_text())
        self.seconds, self.notebooks, self.tree = noted["seconds"], noted["notebooks"], tree(self.kept)

    def again(self, *, without=()) -> Path:
        """`out` as it was then; the notebooks `without` must run anew: their copies are missing."""
        shutil.rmtree(self.out, ignore_errors=True)
        shutil.copytree(self.kept, self.out)
        for name in without:
            next((self.out / "figures").rglob(f"executed/{name}.ipynb")).unlink()
        return self.out
