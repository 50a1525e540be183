"""What the README says can be done can be done."""

import re
from pathlib import Path

import nbformat
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_python_example_runs(tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert "cells" in capsys.readouterr().out
    assert (tmp_path / "my_policy.vsp").exists()


def test_artefacts_and_cells_exist():
    cells = {
        path.stem[:2]: {cell.id for cell in nbformat.read(path, as_version=4).cells}
        for path in (ROOT / "notebooks").glob("*.ipynb")
    }
    rows = re.findall(r"^\| [^|]* \| ([^|]*) \| (\d\d), ([^|]*) \|$", README, flags=re.M)
    assert len(rows) == 12
    for artefacts, notebook, names in rows:
        assert set(re.findall(r"`([^`]+)`", names)) <= cells[notebook]
        for artefact in re.findall(r"`([a-z_/]+)`", artefacts):
            assert list((ROOT / "figures").glob(f"{artefact}.*")), artefact


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert target.startswith("https://") or (ROOT / target).exists(), target


def test_results_are_those_of_the_tables():
    tables = {
        name: pd.read_csv(ROOT / "figures" / "tables" / f"{name.lower()}_spread.csv", index_col="metric")
        for name in ("SimpleGoal", "MountainCar")
    }
    rows = re.findall(r"^\| (SimpleGoal|MountainCar), ([a-z]+)[^|]* \| (.*) \|$", README, flags=re.M)
    assert len(rows) == 8
    for task, metric, cells in rows:
        expected = tables[task].rename(index={"Median/Q2": "Median"}).loc[metric.capitalize()]
        assert cells.split(" | ") == [f"{value:.3f}" for value in expected]
