"""The set-up in the Makefile: what is stale is said and made anew, and nothing that was killed blocks. No downloads."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from vsp.store import ROOT

REAL = f'#!/bin/sh\nexec "{sys.executable}" "$@"\n'
# A Python 3.11 that sets up nothing: `-m venv` fails, or takes long
BROKEN = REAL.replace("exec", 'if [ "$2" = venv ]; then echo no room >&2; exit 1; fi\nexec')
SLOW = REAL.replace("exec", 'if [ "$2" = venv ]; then mkdir .venv; sleep 30; fi\nexec')
OTHER = "#!/bin/sh\nexit 1\n"  # says that it is not 3.11
NAMES = {BROKEN: "-broken", SLOW: "-slow", OTHER: "3.12"}


@pytest.fixture
def checkout(tmp_path):
    """The Makefile and what the set-up reads, and in .venv a Python that has all packages."""
    folder = tmp_path / "größe und äpfel"
    for name in ("Makefile", "environment.lock", "pyproject.toml", "vsp/environment.py"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    (folder / ".venv" / "bin").mkdir(parents=True)
    script(folder / ".venv" / "bin" / "python", REAL)
    subprocess.run([".venv/bin/python", "-X", "utf8", "-I", "vsp/environment.py", "--built"], cwd=folder, check=True)
    return folder


def script(path, text):
    path.write_text(text)
    path.chmod(0o755)
    return path


def start(checkout, python, **options):
    environ = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    there = script(checkout.parent / f"python{NAMES[python]}", python)
    return subprocess.Popen(
        ["make", "venv", f"PYTHON={there}"], cwd=checkout, env=environ,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True, **options,
    )  # fmt: skip


def make(checkout, python=BROKEN):
    process = start(checkout, python)
    return process.communicate(timeout=30)[0], process.returncode


def test_what_is_whole_is_left(checkout):
    assert make(checkout) == ("", 0)


def test_a_stale_environment_is_named_and_not_used(checkout):
    with open(checkout / "environment.lock", "a") as lock:
        lock.write("# edited\n")
    said, status = make(checkout)
    assert status and "environment.lock has changed" in said and "no room" in said and "git checkout" in said
    assert not (checkout / ".venv").exists()
    said, status = make(checkout)
    assert status and "has changed" not in said and "Setting up" in said


def test_python_gone_and_of_another_version(checkout):
    (checkout / ".venv" / "bin" / "python").unlink()
    said, status = make(checkout)
    assert status and "its Python does not run" in said
    said, status = make(checkout, OTHER)
    assert status and f"tried {checkout.parent / 'python3.12'}, expected Python 3.11" in said and "make PYTHON=" in said


def test_a_killed_set_up_blocks_nobody(checkout):
    """While it goes on, another make waits; after its end, or SIGKILL, the other one begins anew."""
    (checkout / ".venv" / "built-from").unlink()
    first = start(checkout, SLOW)
    assert first.stdout.readline() == ".venv is not what environment.lock says: its set-up did not end\n"
    second = start(checkout, BROKEN)
    assert second.stdout.readline() == "another make is setting up .venv: waiting for it to end\n"
    time.sleep(0.3)
    assert second.poll() is None
    os.killpg(first.pid, signal.SIGKILL)
    said = second.communicate(timeout=20)[0]
    assert second.returncode and "its Python does not run" in said and "no room" in said
    first.communicate()


def test_a_closed_output_folder_is_named(checkout):
    (checkout / "out").write_text("a file")
    done = subprocess.run(["make", "begin", "OUT=out"], cwd=checkout, capture_output=True, text=True)
    assert done.returncode and "error: out cannot be written: make it writable, or name another folder" in done.stderr


@pytest.mark.parametrize("jobs", ["", "0", "03", "two", "2 3"])
def test_a_number_of_jobs_that_is_none_is_named(checkout, jobs):
    done = subprocess.run(["make", "help", f"JOBS={jobs}"], cwd=checkout, capture_output=True, text=True)
    assert done.returncode and f"JOBS is {jobs}, expected a number from 1 on" in done.stderr
