"""`.ci/compare.py`: on the CPU type of the committed files, every figure, table and executed notebook counts."""

import importlib.util
import shutil

import pytest

from vsp.run.atomic import ROOT
from vsp.run.listed import write_listed
from vsp.run.machine import cpu_type

FILES = ("a.png", "a.pdf", "tables/a.csv", "executed/a.ipynb")


@pytest.fixture
def module():
    spec = importlib.util.spec_from_file_location("compare", ROOT / ".ci" / "compare.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def compare(module, tmp_path, monkeypatch):
    """`compare()` compares what lies in two folders that are the same at first, and returns what it says."""
    for name in FILES:
        path = tmp_path / "here" / "figures" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    shutil.copytree(tmp_path / "here", tmp_path / "made")
    write_listed(tmp_path / "here" / "data" / "results" / "made_on.txt", cpu_type() + "\n")
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr("sys.argv", ["compare.py", "../made"])
    return module.main


def test_another_cpu_type_finds_the_committed_statistics(module, monkeypatch):
    monkeypatch.chdir(ROOT)
    teacher, distilled = module.committed("SimpleGoal-v0")
    assert teacher["mean"] > distilled["mean"] and teacher["outliers"] < distilled["outliers"]


def test_equal_files_pass(compare, capsys):
    compare()
    assert capsys.readouterr().out == "all 4 files of figures/ have the same bytes\n"


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("missing", [True, False])
def test_a_missing_or_different_file_is_named(compare, tmp_path, name, missing):
    path = tmp_path / "made" / "figures" / name
    path.unlink() if missing else path.write_text("other")
    with pytest.raises(SystemExit, match=f"^differ: figures/{name}$"):
        compare()
