"""What the README says can be done can be done."""

import re
from pathlib import Path

import measured
import pandas as pd

from vsp.notebook import nbformat

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
    assert len(rows) == 30
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


def test_ledger_counts_are_those_of_the_ledger():
    book = pd.read_csv(ROOT / "figures" / "tables" / "ledger.csv")
    verdicts = ["reproduced", "differs", "cannot be checked", "contradicts itself"]
    for part, name in (
        ("settings", "settings and counts"),
        ("results", "results"),
        ("coefficients", "coefficients[^|]*"),
    ):
        (cells,) = re.findall(rf"^\| {name} \| (.*) \|$", README, flags=re.M)
        found = book.loc[book["part"] == part, "verdict"].value_counts()
        assert [int(n) for n in cells.split(" | ")] == [found.get(verdict, 0) for verdict in verdicts]


def test_headline_is_that_of_the_table():
    table = pd.read_csv(ROOT / "figures" / "tables" / "beyond_headline.csv")
    block = README.partition("## Three or four cells")[2].partition("\n## ")[0]
    pattern = r"^\| (\w+) \| ([-\d.]+) \| (\d+) \| ([-\d.]+) \| (\d+) % \| ([-\d.]+) \| (\d+) % \|$"
    rows = re.findall(pattern, block, flags=re.M)
    assert rows == [
        (row["task"], f"{row['teacher']:.2f}", f"{row['cells']}", f"{row['mean']:.2f}", f"{100 * row['reached']:.0f}",
         f"{row['rival mean']:.2f}", f"{100 * row['rival reached']:.0f}")
        for row in table.to_dict("records")
    ]  # fmt: skip


def test_what_is_found_without_a_teacher_is_that_of_the_table():
    table = pd.read_csv(ROOT / "figures" / "tables" / "beyond_ablation.csv")
    without = table[table["part"] == "no teacher"].set_index("task")["mean"]
    lander = pd.read_csv(ROOT / "figures" / "tables" / "beyond_lunarlander.csv").set_index(["method", "size"])["mean"]
    pattern = r"SimpleGoal \(([\d.]+)\), and fail on Pendulum \((-[\d.]+)\) and LunarLander \(([\d.]+)\)"
    (text,) = re.findall(pattern, README)
    found = without["SimpleGoal"], without["Pendulum"], lander["refined, no teacher", 4]
    assert text == tuple(f"{mean:.2f}" for mean in found)
    assert re.findall(r"as any partition does\n  \(([\d.]+)\)", README) == [f"{lander['refined', 1]:.2f}"]


def test_the_printed_policy_is_that_of_the_table():
    table = (ROOT / "figures" / "tables" / "beyond_pendulum_policy.csv").read_text(encoding="utf-8")
    (block,) = re.findall(r"```text\n(Pendulum-v1: .*?)```", README, flags=re.S)
    cells = re.findall(r"^nearest to (.*):\n  τ = (.*)$", block, flags=re.M)
    assert len(cells) == len(table.splitlines()) - 1
    for row, (codeword, equation) in zip(table.splitlines()[1:], cells):
        found, printed = (
            re.findall(r"-?\d+\.?\d*", text.replace("- ", "-")) for text in (row, f"{codeword} {equation}")
        )
        assert found == printed


def test_what_cells_buy_is_that_of_the_table():
    table = pd.read_csv(ROOT / "figures" / "tables" / "what_cells_buy.csv")
    block = README.partition("### What do the cells buy?")[2]
    rows = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", block, flags=re.M)
    shown = {tuple(row[1:3]) for row in rows}, {tuple(row[3:]) for row in rows}
    for (_, kinds), found in zip(table.groupby("task", sort=False), shown, strict=True):
        kinds = kinds.to_dict("records")
        assert found == {(f"{row['mean']:.2f}", f"{100 * row['failing']:.1f}") for row in kinds}


def test_measured_figures_are_those_of_the_table():
    """Else: `python tests/measured.py build/measured data/results README.md` puts them there."""
    assert measured.markdown(ROOT / "data" / "results" / "trust.csv") in README


def test_what_the_promises_name_is_there():
    page = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:tests|\.ci|data)/[\w./]+)`", page))
    assert len(named) > 8 and all((ROOT / name).exists() for name in named)
