"""The wheel, installed where no checkout is: it brings the teachers and the paper's values, and distils."""

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from shutil import copy, copytree, ignore_patterns

import pytest

from vsp.run.atomic import ROOT

USE = """
import importlib.util, vsp, vsp_beyond
from vsp.paper.results import read_results
from vsp.teachers.teacher import further_teachers

teacher = vsp.load_teacher("SimpleGoal-v0")
policy, _ = vsp.distill(teacher, "SimpleGoal-v0", vsp.preset("SimpleGoal-v0").quick(), seed=0)
quick = vsp_beyond.faithful_preset("SimpleGoal-v0", n_cells=1).quick()
few = vsp_beyond.faithful(teacher, "SimpleGoal-v0", quick, seed=0)
print([vsp.__file__, vsp_beyond.__file__])
print(len(policy), len(few), len(vsp.paper.published_policy("SimpleGoal-v0")), len(further_teachers("Pendulum-v1")))
print([importlib.util.find_spec(name) for name in ("studies", "vsp_course")])
read_results("ledger")
"""


def run(*command, cwd):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    for part in ("vsp", "vsp_beyond", "studies", "vsp_course", "data/paper", "data/teachers"):
        copytree(ROOT / part, folder / "source" / part, ignore=ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        copy(ROOT / name, folder / "source" / name)
    options = ["-q", "--no-deps", "--no-build-isolation", "--wheel-dir", "."]
    done = run(sys.executable, "-m", "pip", "wheel", *options, "./source", cwd=folder)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("vsp-*.whl")
    return path


def test_it_holds_code_teachers_and_the_papers_values_in_13_megabytes(wheel):
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    code = {path.relative_to(ROOT).as_posix() for part in ("vsp", "vsp_beyond") for path in (ROOT / part).rglob("*.*")
            if path.suffix in (".py", ".js", ".json", ".css", ".html", ".c", ".v")}  # fmt: skip
    data = {path.relative_to(ROOT).as_posix() for part in ("paper", "teachers")
            for path in (ROOT / "data" / part).rglob("*") if path.is_file()}  # fmt: skip
    assert names == code | {f"vsp/{name}" for name in data}
    assert 12e6 < wheel.stat().st_size < 13e6  # as data/README.md says


def test_an_installed_wheel_distils_from_another_folder(wheel, tmp_path):
    venv.create(tmp_path / "venv")
    python, purelib = str(tmp_path / "venv/bin/python"), sysconfig.get_path("purelib")
    (site_packages,) = (tmp_path / "venv/lib").glob("python3*/site-packages")
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", str(wheel)]
    assert run(*pip, cwd=tmp_path).returncode == 0
    (site_packages / "dependencies.pth").write_text(purelib)  # .venv's own vsp.pth is not read from there
    (tmp_path / "elsewhere").mkdir()
    done = run(python, "-c", USE, cwd=tmp_path / "elsewhere")
    places, sizes, absent = done.stdout.splitlines()[-3:]
    assert places.count(str(site_packages)) == 2 and sizes.split()[1:] == ["1", "13", "2"] and int(sizes[0]) > 0
    assert absent == "[None, None]" and not any((tmp_path / "elsewhere").iterdir())
    assert "ledger.csv: no such file: it lies in the checkout only: `git clone" in done.stderr.splitlines()[-1]
