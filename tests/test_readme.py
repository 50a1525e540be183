"""The README and docs/: examples run, links lead somewhere, and what is quoted equals the tables."""

import math
import pydoc
import re
import subprocess
import tomllib

import numpy as np
import pandas as pd
import pytest

import vsp
from studies.comparison import all_rows, largest_alike, method_summary, read_results
from vsp.paper import quartiles_from_fences
from vsp.run.atomic import ROOT
from vsp.run.notebook import nbformat

PAGES = [ROOT / "README.md", ROOT / "data" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
README = PAGES[0].read_text("utf-8")
RESULTS = (ROOT / "docs" / "results.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("page", "said"), [("README.md", "R² 0.98"), ("docs/use.md", "push east = -1.50")], ids=["README", "use"]
)
def test_python_example_runs(page, said, tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text("utf-8"), flags=re.S)
    monkeypatch.chdir(tmp_path)
    example = example.replace("Dock-v0", "DockOfReadme-v0")  # other tests have a Dock-v0 of their own
    exec(compile(example, page, "exec"), {})
    assert said in capsys.readouterr().out and len(example.splitlines()) <= 40
    assert (tmp_path / "my_policy.vsp").exists() == (page == "README.md")


def test_the_readme_is_short():
    assert len(README.split()) <= 700


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    folders = (page.parent, ROOT) if page.name == "index.md" else (page.parent,)  # the index is for the site alone
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8")):
        assert target.startswith("https://") or any((folder / target).exists() for folder in folders), target


def test_a_link_of_the_readme_leads_to_the_condition_of_a_split():
    ((file, number),) = re.findall(r"\]\((vsp/[\w/]+\.py)#L(\d+)\)", README)
    line = (ROOT / file).read_text("utf-8").splitlines()[int(number) - 1]
    assert line.strip().startswith("if ") and "config.max_pol_loss" in line, f"{file}:{number} is {line!r}"


def test_targets_exist():
    known = subprocess.run(["make", "-npq", "help"], cwd=ROOT, capture_output=True, text=True).stdout
    targets = set(re.findall(r"^([a-z][\w-]*):", known, flags=re.M))
    for page in PAGES:
        for words in re.findall(r"`make ([a-z][a-z -]*)`", page.read_text("utf-8")):
            assert set(words.split()) <= targets, f"{page.name}: make {words}"


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_names_exist(page):
    text = page.read_text("utf-8")
    names = re.findall(r"`((?:vsp|vsp_beyond|studies)(?:\.\w+)+)", text)
    assert [name for name in names if pydoc.locate(name) is None] == []
    paths = re.findall(r"`((?:vsp|vsp_beyond|studies|vsp_course|tests|\.ci)/[\w/.]*)`", text)
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_one_version_everywhere():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)[1] == version


# Quoted results


def read_table(name, **options):
    """The table NAME of figures/tables, or beyond/NAME of figures/beyond/tables."""
    folder, _, file = name.rpartition("/")
    return pd.read_csv(ROOT / "figures" / folder / "tables" / f"{file}.csv", **options)


def section(title, page="docs/results.md"):
    """The text below a heading of a page, up to the next heading of its level or above."""
    level, text = len(title.partition(" ")[0]), (ROOT / page).read_text("utf-8")
    return re.split(rf"^#{{1,{level}}} ", text.partition(f"{title}\n")[2], flags=re.M)[0]


def rows_of(text, width):
    """The cells of all rows with `width` cells in the Markdown tables of `text`, but not of the headers."""
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    return [row for row in rows if len(row) == width and re.search("[0-9]", "".join(row[1:]))]


def test_counts_are_those_of_the_ledger():
    book, said = read_table("ledger"), " ".join(RESULTS.split())
    counts = book.groupby("part")["verdict"].value_counts()
    verdicts = ("reproduced", "differs", "cannot be checked", "contradicts itself")
    for part, cells in zip(("settings", "results", "coefficients"), rows_of(section("## Did it reproduce?"), 5)):
        assert [int(n) for n in cells[1:]] == [counts[part].get(verdict, 0) for verdict in verdicts]
    checked = book[(book["part"] == "results") & book["verdict"].isin(verdicts[:2])]
    reproduced, once = checked["verdict"] == "reproduced", checked.drop_duplicates(["task", "subject", "value"])
    wide, share = (checked["wide"] & reproduced).sum(), f"{reproduced.sum()} of {len(checked)} checkable results"
    assert f"**{share} reproduce** ({wide} with a wide interval)" in README
    assert f"{share} reproduce, {wide} of them with a wide interval" in said
    assert f"The paper prints {len(checked) - len(once)} of these results again" in said
    assert f"{(once['verdict'] == 'reproduced').sum()} of {len(once)} reproduce." in said


def test_settings_and_lost_landings_are_those_of_the_tables():
    counts = read_table("ledger").query("part == 'settings'")["verdict"].value_counts()
    share = f"{counts['reproduced']} of {counts['reproduced'] + counts['differs']}"
    assert f"{share} settings" in " ".join(README.split())
    assert f"{share} checkable settings agree" in " ".join(RESULTS.split())
    tail = read_table("beyond/tail").set_index(["method", "size"])["failing"]
    faithful, teacher = (1000 * tail[row] for row in (("our cells, faithful", 8), ("teacher", 0)))
    said = f"{faithful:.0f} landings in a thousand fail, {teacher:.0f} of the teacher's"
    assert said in " ".join(RESULTS.split())


def test_the_printed_policy_is_that_of_the_table():
    table = (ROOT / "figures/beyond/tables/pendulum_policy.csv").read_text("utf-8")
    (block,) = re.findall(r"```text\n(Pendulum-v1: .*?)```", RESULTS, flags=re.S)
    cells = re.findall(r"^nearest to (.*):\n  τ = (.*)$", block, flags=re.M)
    for row, cell in zip(table.splitlines()[1:], cells, strict=True):
        in_table, said = (re.findall(r"-?\d+\.?\d*", text.replace("- ", "-")) for text in (row, " ".join(cell)))
        assert in_table == said


def test_what_cells_buy_is_that_of_the_table():
    block = RESULTS.partition("### What do the cells buy?")[2]
    shown = re.findall(r"^\| [^|]+ \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", block, flags=re.M)
    for (_, kinds), place in zip(read_table("what_cells_buy").groupby("task", sort=False), (0, 2), strict=True):
        rows = {
            (f"{row.mean_:.2f}", f"{100 * row.failing:.1f}")
            for row in kinds.rename(columns={"mean": "mean_"}).itertuples()
        }
        assert {row[place : place + 2] for row in shown} == rows


def test_faithful_policies_are_those_of_the_table():
    table = read_table("beyond/faithful").set_index("task")
    teachers = read_table("beyond/headline").set_index("task")["teacher"]
    assert rows_of(section("## A few equations that act like the teacher"), 7) == [
        [task, f"{row['at most']}", f"{row['r2']:.3f}", f"{row['mean']:.2f}", f"{teachers[task]:.2f}",
         f"{row['both'] * row['policies']:.0f} of {row['policies']}", f"{row['index']:.2f}"]
        for task, row in table.iterrows()
    ]  # fmt: skip


def test_who_leads_is_that_of_the_table():
    table = read_table("beyond/leaders").set_index(["task", "size"])
    assert (table["ahead"] != "ours").all() and table["rival"]["MountainCar", 2] == "oblique tree, constants"
    assert set(table.loc["SimpleGoal", "ahead"]) == set(table.loc["LunarLander", "ahead"]) == {"level"}


def test_the_headline_is_that_of_the_table():
    assert rows_of(section("## Tuned for the return"), 7) == [
        [row["task"], f"{row['teacher']:.2f}", f"{row['cells']}", f"{row['mean']:.2f}", f"{100 * row['reached']:.0f} %",
         f"{row['rival mean']:.2f}", f"{100 * row['rival reached']:.0f} %"]
        for row in read_table("beyond/headline").to_dict("records")
    ]  # fmt: skip


def test_the_limit_is_that_of_the_tables():
    best = read_table("beyond/limit_references").set_index("task")
    sizes = read_table("beyond/limit_sizes").set_index(["task", "size"])
    rows = rows_of(section("## How good can a few cells be?"), 6)
    assert len(rows) == 4
    for task, possible, teacher, cells, mean, near in rows:
        row = sizes.loc[task, int(cells)]
        assert [mean, near] == [f"{row['mean']:.3f}", f"{row['near'] * row['policies']:.0f} of {row['policies']:.0f}"]
        if task in best.index:
            assert [possible, teacher] == [f"{best.loc[task, column]:.3f}" for column in ("best", "teacher")]


TABLES = {  # a task stands for the summary of its rows
    ("README.md", "## Results"): "simplegoal_spread what_cells_buy faithful",
    ("docs/explore.md", "### Three cells against thirteen"): "proofs_simplegoal",
    ("docs/results.md", "## Did it reproduce?"):
        "simplegoal_spread mountaincar_spread text_numbers what_cells_buy limit_references",
    ("docs/results.md", "## A few equations that act like the teacher"):
        "faithful headline leaders equal apart teachers LunarLanderContinuous-v3",
    ("docs/results.md", "## Tuned for the return"):
        "headline equal pendulum_policy SimpleGoal-v0 Pendulum-v1 MountainCarContinuous-v0 "
        "LunarLanderContinuous-v3",
    ("docs/results.md", "## How good can a few cells be?"):
        "limit_references limit_sizes limit_starts limit_robots headline leaders",
    ("docs/results.md", "## What is certain?"): "proofs_simplegoal proofs_pendulum proofs_teacher proofs_dead_points",
}  # fmt: skip


def table_of(name):
    """A table of the paper, one of ours, or the summary of a task's rows."""
    if name in vsp.task_names():
        return method_summary(all_rows(name))
    return read_table(name if (ROOT / f"figures/tables/{name}.csv").exists() else f"beyond/{name}")


def values_of(tables):
    """Every number in these tables, also in their texts, as it is and in percent."""
    cells = pd.concat([pd.Series(table.to_numpy().ravel()) for table in tables]).dropna().astype(str)
    values = np.array([float(number) for cell in cells for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", cell)])
    return np.concatenate([values, 100 * values])


@pytest.mark.parametrize(("page", "title"), TABLES)
def test_every_decimal_number_of_a_section_is_in_its_tables(page, title):
    """Rounded as the text rounds it. A few come from elsewhere: the teacher's card, proofs, the mean by integration."""
    possible = 10 * (math.sqrt(2) + math.asinh(1)) / 3 + 9 + math.pi / 1200  # the mean of max(10, 10 d + 9)
    elsewhere = pd.DataFrame([vsp.load_teacher("SimpleGoal-v0").card["score"]["mean"], possible])
    values = values_of([*map(table_of, TABLES[page, title].split()), read_results("proofs"), elsewhere])
    numbers = re.findall(r"(?<!Figure )(?<![\w.,])(-?\d+\.\d+|\d+(?= %))", section(title, page))
    digits = {number: len(number.partition(".")[2]) for number in numbers}
    assert len(numbers) > 1
    missing = [n for n in digits if not np.isclose(values.round(digits[n]), float(n), rtol=0, atol=1e-9).any()]
    assert missing == []


def notebook(name):
    """The text of a notebook in one line."""
    (path,) = (ROOT / "notebooks").glob(f"{name}_*.ipynb")
    cells = nbformat.read(path, as_version=4).cells
    return " ".join(" ".join(cell.source for cell in cells if cell.cell_type == "markdown").split())


def test_up_to_how_many_cells_seeds_agree_is_that_of_the_table():
    sizes = dict(list(read_table("beyond/sizes").groupby("task")))
    said = "with up to {} cells on SimpleGoal, {} on MountainCar and {} on Pendulum"
    most = (largest_alike(sizes[task]) for task in ("SimpleGoal", "MountainCar", "Pendulum"))
    assert said.format(*most) in " ".join(RESULTS.split())


def test_episodes_that_the_text_compares_are_those_of_the_table():
    table = read_table("beyond/budgets").set_index(["task", "method"])
    episodes, tuning = table["teacher"].unstack("task"), table["tuning"].unstack("task")
    times = episodes.loc["our cells, faithful"] / episodes.loc["our cells, tuned"]
    said = f"{times.min():.0f} to {times.max():.0f} times as many episodes of the teacher"
    assert all(said in text for text in (" ".join(RESULTS.split()), notebook("06"), notebook("09")))
    more = tuning.loc["our cells, tuned"] / tuning.loc["one linear map, tuned"]
    assert f"our cells get up to {more.max():.1f} times as many as one linear map" in notebook("06")


def test_how_far_mountaincar_is_from_the_paper_is_that_of_the_ledger():
    row, said = read_table("ledger", index_col="id"), notebook("05")
    teacher = row["here"]["mc_drl_mean"] - row["value"]["mc_drl_mean"]
    implied = quartiles_from_fences(row["value"]["mc_ours_whisker_low"], row["value"]["mc_ours_whisker_high"])
    rerun = [row["here"][f"mc_spread_ours_{name}"] for name in ("q1", "q3")]
    (below,) = {round(here - there, 1) for here, there in zip(rerun, implied, strict=True)}
    assert f"returns {teacher:.2f} more than the paper's." in said and 0.4 < teacher / below < 0.55
    assert f"lie {below} below the rerun's" in said
