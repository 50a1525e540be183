"""The Makefile and environment.sh, with a Python that notes what it is asked for and downloads nothing."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib

import pytest

from vsp.run.atomic import ROOT

FAKE = ROOT / "tests" / "run" / "fake"


@pytest.fixture
def checkout(tmp_path):
    """The Makefile and what it reads, without a .venv."""
    folder = tmp_path / "größe und äpfel"
    shutil.copytree(ROOT / "notebooks", folder / "notebooks")
    copied = "Makefile environment.sh vsp/run/kernels.py data/paper/spread.csv data/teachers/MANIFEST.sha256"
    studies = [f"data/results/{name}.csv" for name in ("hub_teacher_ledger", "simpler", "verdicts")]
    for name in [*copied.split(), *studies]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    shutil.copy(FAKE / "environment.lock", folder)
    shutil.copy(FAKE / "python", folder.parent)
    return folder


def start(checkout, *arguments, env=None):
    of_make = ("MAKE", "MFLAGS", "OUT", "JOBS", "DASK", "QUICK", "FILES", "FORCE")  # of the make that runs the tests
    environ = {name: value for name, value in os.environ.items() if not name.startswith(of_make)}
    environ |= {"FAKE_REAL": sys.executable} | (env or {})
    command = ["make", f"PYTHON={checkout.parent / 'python'}", *arguments]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "start_new_session": True}
    return subprocess.Popen(command, cwd=checkout, env=environ, **options)


def make(checkout, *arguments, **env):
    process = start(checkout, *arguments, env=env)
    said = process.communicate(timeout=60)[0]
    return said, process.returncode


def asked(checkout):
    """What Python was asked for since the last time."""
    path = checkout / "asked"
    text = path.read_text() if path.exists() else ""
    path.write_text("")
    return text


def packages(checkout):
    return {path.name for path in checkout.glob(".venv/lib/python3*/site-packages/*.dist-info")}


# Set-up


@pytest.fixture
def venv(checkout):
    make(checkout, "venv")


def test_parts_are_added_when_they_are_asked_for_and_what_is_whole_is_left(checkout):
    said, status = make(checkout, "venv", PYTHONWARNINGS="error")
    assert status == 0 and packages(checkout) == {"numpy-2.0.dist-info"} and "to draw (1 MB of downloads)" in said
    assert "--require-hashes" in asked(checkout)
    assert make(checkout, "venv") == ("", 0) and asked(checkout) == ""
    said, status = make(checkout, "venv-train")
    assert status == 0 and "torch (3 GB of downloads)" in said and "Setting up" not in said
    assert packages(checkout) == {"numpy-2.0.dist-info", "zebra-1.0.dist-info"}  # torch is installed from its own file
    assert "download -qq --no-deps --dest .venv/torch torch==2.13.0" in asked(checkout)
    assert make(checkout, "venv-train") == make(checkout, "venv") == ("", 0) and asked(checkout) == ""


def test_torch_with_another_checksum_is_refused_and_the_first_part_goes_on_working(checkout, venv):
    said, status = make(checkout, "venv-train", FAKE_HASH="beef")
    assert status and "error: SHA-256 of torch.whl is not among those of torch==2.13.0 in environment.lock" in said
    assert make(checkout, "venv") == ("", 0)
    said, status = make(checkout, "venv-train")
    assert status == 0 and "it is made anew" in said


STALE = {
    "lock": lambda folder: (folder / "environment.lock").write_bytes((FAKE / "environment.lock").read_bytes() + b"#\n"),
    "killed": lambda folder: (folder / ".venv/note").unlink(),
    "python": lambda folder: (folder / ".venv/bin/python").unlink(),
    "package": lambda folder: (folder / ".venv/lib/python3.11/site-packages/numpy-2.0.dist-info").rmdir(),
    "moved": lambda folder: folder.rename(folder.parent / "elsewhere"),
}


@pytest.mark.parametrize("fault", STALE)
def test_a_stale_environment_is_made_anew(checkout, venv, fault):
    moved = STALE[fault](checkout)
    here = moved if fault == "moved" else checkout
    said, status = make(here, "venv", FAKE_BROKEN="install")
    assert status and "stale or not whole" in said and "error: .venv is not whole, the next make begins anew" in said
    said, status = make(here, "venv")
    assert status == 0 and "stale or not whole" in said and packages(here) == {"numpy-2.0.dist-info"}
    assert make(here, "venv") == ("", 0)


def test_another_python_makes_it_anew_and_one_too_old_is_named(checkout, venv):
    said, status = make(checkout, "venv", "PYTHON=no such python")
    assert status and "tried no such python, expected Python 3.11, 3.12 or 3.13" in said and "make PYTHON=" in said
    assert make(checkout, "venv") == ("", 0)
    assert "stale" in make(checkout, "venv", FAKE_VERSION="3.12.1")[0]


def test_a_killed_set_up_blocks_nobody(checkout):
    """While it goes on, another make waits; after its end, or SIGKILL, the other one begins anew."""
    first = start(checkout, "venv", env={"FAKE_SLOW": "1"})
    assert first.stdout.readline().startswith("Setting up .venv with ")
    second = start(checkout, "venv")
    assert second.stdout.readline() == "another make is setting up .venv: waiting for it to end\n"
    time.sleep(0.3)
    assert second.poll() is None
    os.killpg(first.pid, signal.SIGKILL)
    said = second.communicate(timeout=20)[0]
    assert second.returncode == 0 and "stale or not whole" in said
    first.communicate()
    assert make(checkout, "venv") == ("", 0)


PARTS = {
    "paper-figures all lab 01_teacher figures/ledger.pdf": {"draw"},
    "beyond-long": {"draw", "train", "mujoco"},
    "test": {"draw", "train", "test", "dask"},
    "site": {"draw", "site"},
}


@pytest.mark.parametrize("targets", PARTS)
def test_a_target_asks_for_the_parts_that_it_needs(checkout, targets):
    for target in targets.split():
        for dask in ("", "tcp://host:8786"):
            said = make(checkout, "-n", target, *([f"DASK={dask}"] if dask else []))[0]
            lines = re.findall(r"^sh environment.sh (.*)", said, re.MULTILINE)
            assert set(" ".join(lines).split()) == PARTS[targets] | ({"dask"} if dask else set()), target


def test_the_lock_has_what_the_project_asks_for_with_checksums():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    parts = re.split(r"^## ([a-z]+): .*\n", (ROOT / "environment.lock").read_text(), flags=re.MULTILINE)
    locked = {
        name: re.findall(r"^([a-z0-9-]+)==.*\n((?: +--hash.*\n)+)", text, re.M)
        for name, text in zip(*[iter(parts[1:])] * 2)
    }
    for name, asked in (("draw", project["dependencies"]), *project["optional-dependencies"].items()):
        there = {package for package, hashes in locked["draw"] + locked[name] if hashes}
        assert {re.match(r"[\w-]+", one)[0] for one in asked} <= there
    assert not {"torch", "stable-baselines3", "distributed"} & {package for package, _ in locked["draw"]}


# What users set

ODD = ["Tim's \"results\" `touch hit`", "$(touch hit) $(shell touch hit) $HOME $$ ${x}", "-x #5 100 % back\\slash\\n",
       ";touch hit * ? two\nlines", "tab\tand & | < > a=b:c größe"]  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_any_path_works(checkout, venv, name):
    for out in (name, str(checkout.parent / name)):
        there = set(checkout.iterdir())
        asked(checkout)
        said, status = make(checkout, "runs", "01_teacher", f"OUT={out}", "JOBS=3", "QUICK=1")
        runs, notebook = asked(checkout).split("\n<-m>")
        given = out if out.startswith("/") else f"./{out}"
        assert (status, runs) == (0, f"<-m><vsp.paper.make_runs><--out={given}><--jobs=3><--quick>"), said
        assert f"<--out={given}><--executed=figures/executed><--quick>" in notebook
        assert {path.name for path in set(checkout.iterdir()) - there} <= {name, "asked"}
        assert (checkout / out / "figures/environments.pdf").exists()
        make(checkout, "clean", f"OUT={out}")
        assert not (checkout / out / "data/runs").exists()


def test_any_path_reaches_the_makes_inside(checkout, venv):
    said, status = make(checkout, "quick", "OUT=$(HOME) `touch hit` 'x\"", "DASK=://`touch hit`")
    given = asked(checkout)
    assert "<--out=./$(HOME) `touch hit` 'x\"/build/quick><--jobs=://`touch hit`><--quick>" in given, said
    assert given.count("run_notebook") == 5 and status == 0 and not (checkout / "hit").exists()


def test_modules_of_tests_run_by_their_names_and_all_without_one(checkout):
    (checkout / "tests").mkdir()
    for name in "abc":
        (checkout / "tests" / f"test_{name}.py").write_text("def test_it():\n    pass\n")
    for files, passed in (("tests/test_a.py", 1), ("tests/test_a.py tests/test_b.py", 2), ("", 3)):
        said, status = make(checkout, "test", f"FILES={files}")
        assert status == 0 and f"{passed} passed" in said and ("nodes" in said) == (not files), said
    assert make(checkout, "test", "FILES=$(touch hit) `touch hit`")[1] and not (checkout / "hit").exists()


def test_what_cannot_be_is_refused_in_one_line(checkout, venv):
    (checkout / "file").write_text("")
    for jobs in ("", "03", "2 `touch hit`"):
        said, status = make(checkout, "runs", f"JOBS={jobs}")
        assert status and said.startswith(f"error: JOBS is {jobs}, expected a number from 1 on\nmake: ***")
    said, status = make(checkout, "runs", "OUT=file")
    assert status and "error: ./file cannot be written: make it writable, or name another" in said
    said, status = make(checkout, "runs", "OUT=")
    assert status and "OUT is empty, expected a folder" in said
    assert not (checkout / "hit").exists()


# What is up to date


@pytest.fixture
def ran(checkout, venv):
    """`ran(target)`: which notebooks run for it."""

    def ran(*targets):
        asked(checkout)
        said, status = make(checkout, *targets)
        assert status == 0, said
        return sorted(re.findall(r"<notebooks/(\w+).ipynb>", asked(checkout)))

    return ran


PAPER = ["01_teacher", "02_distillation", "03_evaluation", "04_appendix_tables", "05_ledger"]


def test_a_notebook_runs_again_when_what_it_reads_is_newer_or_what_it_makes_is_missing(checkout, ran):
    """What somebody altered, or emptied, is named and stays, until FORCE=1."""
    assert ran("paper-figures") == PAPER and ran("paper-figures") == []
    figure = checkout / "figures" / "environments.pdf"
    for altered in ("altered", ""):
        figure.write_text(altered)
        said, status = make(checkout, "01_teacher")
        assert status and "environments.pdf was edited or damaged since make made it" in said
        assert figure.read_text() == altered and ran("01_teacher", "FORCE=1") == ["01_teacher"]
    (checkout / "build" / "stamps" / "01_teacher").write_text("quick=\n")  # as stamps were, without checksums
    figure.write_text("altered")
    assert ran("01_teacher") == ["01_teacher"]
    commit = "git init -q; git add figures; git -c user.name=a -c user.email=a commit -qam a"
    for text in ("made", "pulled"):
        figure.write_text(text)
        subprocess.run(commit, shell=True, cwd=checkout)
    assert ran("figures/environments.pdf") == ["01_teacher"] and ran("01_teacher") == []
    for name in ("notebooks/01_teacher.ipynb", "vsp/run/kernels.py", "data/paper/spread.csv", "environment.lock"):
        with open(checkout / name, "a") as file:
            file.write("# edited\n")
        assert ran("figures/environments.pdf") == ["01_teacher"] and ran("01_teacher") == []
    figure.unlink()
    assert ran("01_teacher") == ["01_teacher"] == ran("01_teacher", "QUICK=1")
    (checkout / "studies").mkdir()
    (checkout / "studies" / "new.py").touch()
    (checkout / "vsp" / "__pycache__").mkdir()
    (checkout / "vsp" / "__pycache__" / "new.pyc").touch()
    assert ran("01_teacher", "QUICK=1") == []


def test_the_notebooks_of_a_fresh_clone_run_and_those_beyond_the_paper_read_the_studies(checkout, ran):
    for folder in ("vsp_beyond", "studies", "data/beyond"):
        (checkout / folder).mkdir(parents=True)
    shutil.copytree(ROOT / "figures", checkout / "figures", dirs_exist_ok=True)
    assert len(ran("all")) == 12 and ran("all") == []
    for name in ("studies/new.py", "data/beyond/rows.csv"):
        (checkout / name).touch()
        assert [name[:2] for name in ran("all")] == ["06", "07", "08", "09", "10", "11", "12"]


def test_new_runs_reach_the_notebooks_that_draw_them(checkout, ran):
    assert ran("paper-figures") == PAPER
    (checkout / "data" / "teachers" / "new.safetensors").touch()
    assert ran("03_evaluation") == ["03_evaluation"] and ran("03_evaluation", "04_appendix_tables") == PAPER[3:4]


def test_a_notebook_that_failed_runs_again(checkout, ran):
    assert make(checkout, "01_teacher", FAKE_BROKEN="notebook")[1]
    assert ran("01_teacher") == ["01_teacher"]


def test_help_is_short_and_the_list_has_every_artefact():
    said = {name: subprocess.check_output(["make", name], cwd=ROOT, text=True) for name in ("help", "list")}
    assert len(said["help"].splitlines()) <= 30
    book = tomllib.loads((ROOT / "notebooks" / "captions.toml").read_text("utf-8"))
    names = [name.rpartition("/")[2] for kinds in book.values() for entries in kinds.values() for name in entries]
    listed = re.findall(r"^    figures/(?:.*/)?(\w+)\.(?:png|csv)$", said["list"], re.M)
    assert sorted(listed) == sorted(names) and len(names) > 40
