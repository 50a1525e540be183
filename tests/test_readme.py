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
README_LINE, RESULTS_LINE = (" ".join(text.replace("**", "").split()) for text in (README, RESULTS))


def test_the_readme_is_short():
    assert len(README.split()) <= 700


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def test_a_link_of_the_readme_leads_to_the_condition_of_a_split():
    ((file, number),) = re.findall(r"\]\((vsp/[\w/]+\.py)#L(\d+)\)", README)
    line = (ROOT / file).read_text("utf-8").splitlines()[int(number) - 1]
    assert line.strip().startswith("if ") and "config.max_pol_loss" in line, f"{file}:{number} is {line!r}"


def test_the_equations_of_the_readme_are_those_of_a_policy_that_is_proved():
    policy = vsp.VoronoiPolicy.load(ROOT / "data/beyond/limit_MountainCarContinuous-v0.policy")
    least = read_results("proofs").set_index("name")["least"]["mountaincar_limit"]
    teacher = read_table("beyond/limit_references", index_col="task")["teacher"]["MountainCar"]
    said = f"less than {math.floor(1000 * least) / 1000:.3f}; our trained network returns {teacher:.2f}"
    assert policy.to_text() in README and said in " ".join(README.split())


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


def test_counts_and_the_mean_are_those_of_the_ledger():
    book = read_table("ledger", index_col="id")
    facts = book[book["fact"] & (book["subject"] == "Ours")]
    same, differ, untold = (int((facts["verdict"] == one).sum()) for one in ("reproduced", "differs", "cannot be told"))
    begin = f"Of {same + differ + untold} facts about its distilled policies {same} reproduce"
    interval = "{:.1f} (95 %: {:.1f} to {:.1f})".format(*book.loc["sg_spread_ours_mean", ["here", "low", "high"]])
    assert f"{begin}, {differ} differ, and {untold} cannot be told." in README_LINE and interval in README_LINE
    assert f"{begin} and {differ} differ; {untold} cannot be told" in RESULTS_LINE and interval in RESULTS_LINE
    n = sum(part.size for layer in vsp.load_teacher("MountainCarContinuous-v0").layers for part in layer)
    said = f"network of {n:,} numbers (R² {read_table('beyond/faithful', index_col='task')['r2']['MountainCar']:.3f})"
    assert said in RESULTS_LINE and f"its distilled policies, {same} reproduce with our defaults." in RESULTS_LINE


def test_what_the_nearest_settings_reproduce_is_that_of_the_table():
    facts = read_table("hidden_facts").query("verdict != 'contradicts itself'")
    same = (facts["verdict"] == "reproduced").groupby([facts["choice"], facts["task"]]).agg(["sum", "size"])
    goal, car = "SimpleGoal-v0", "MountainCarContinuous-v0"
    first, other = same.loc[("nearest, SimpleGoal", goal)], same.loc[("nearest, MountainCar", car)]
    own, both = ([same.at[(choice, task), "sum"] for task in (goal, car)] for choice in ("default", "nearest, both"))
    said = "the nearest reproduces {} of SimpleGoal's {} facts, another {} of MountainCar's {}"
    assert said.format(*first, *other) in README_LINE
    said = "the nearest reproduces {} of SimpleGoal's {} facts (the default {}), another {} of MountainCar's {} ({}); "
    assert said.format(*first, own[0], *other, own[1]) + "the nearest to both, {} and {}.".format(*both) in RESULTS_LINE


def test_lost_landings_are_those_of_the_tables():
    lost = table_of("LunarLanderContinuous-v3").set_index(["method", "size"])["failing"]
    faithful = read_table("beyond/faithful").set_index("task")["failing"]["LunarLander"]
    said = f"{faithful:.2%} of the landings fail; with the teacher {lost['teacher', 0]:.2%} do".replace("%", " %")
    assert said in RESULTS_LINE


def test_the_printed_policy_is_that_of_the_table():
    table = (ROOT / "figures/beyond/tables/pendulum_policy.csv").read_text("utf-8")
    (block,) = re.findall(r"```text\n(Pendulum-v1: .*?)```", RESULTS, flags=re.S)
    cells = re.findall(r"^nearest to (.*):\n  τ = (.*)$", block, flags=re.M)
    for row, cell in zip(table.splitlines()[1:], cells, strict=True):
        in_table, said = (re.findall(r"-?\d+\.?\d*", text.replace("- ", "-")) for text in (row, " ".join(cell)))
        assert in_table == said


def test_faithful_policies_are_those_of_the_table():
    table = read_table("beyond/faithful").set_index("task")
    names = {task: next(name for name in vsp.task_names() if name.startswith(task)) for task in table.index}
    teachers = {task: table_of(name).set_index("method")["mean"]["teacher"] for task, name in names.items()}
    shares = read_table("beyond/within").groupby("task")["within"]
    within = {task: "/".join(f"{100 * share:.0f}" for share in those) for task, those in shares}
    assert rows_of(section("## A few equations that act like the teacher"), 7) == [
        [task, f"{row['at most']}", f"{row['r2']:.3f}", f"{row['mean']:.2f}", f"{teachers[task]:.2f}",
         f"{row['both'] * row['policies']:.0f} of {row['policies']}", f"{within[task]} %"]
        for task, row in table.iterrows()
    ]  # fmt: skip


def test_who_leads_is_that_of_the_table():
    table = read_table("beyond/leaders")
    who = {verdict: list(zip(rows["task"], rows["size"])) for verdict, rows in table.groupby("ahead")}
    assert who.pop("cannot be told") and len(table) == 18 and "Of 18 comparisons ours win three" in RESULTS
    assert who == {"ours": [("Pendulum", 2), ("Pendulum", 3), ("LunarLander", 2)],
                   "theirs": [("MountainCar", 2), ("MountainCar", 3), ("MountainCar", 4)]}  # fmt: skip


TABLES = {  # a task stands for the summary of its rows
    ("README.md", "## Results"): "simplegoal_spread ledger what_cells_buy faithful hidden_facts",
    ("docs/results.md", "## Did it reproduce?"): "simplegoal_spread ledger what_cells_buy hidden_facts",
    ("docs/results.md", "## A few equations that act like the teacher"):
        "faithful within SimpleGoal-v0 MountainCarContinuous-v0 Pendulum-v1 LunarLanderContinuous-v3",
    ("docs/results.md", "## How good can a few cells be?"): "limit_references limit_sizes limit_robots",
    ("docs/results.md", "## What is certain?"): "proofs_simplegoal proofs_pendulum proofs_dead_points",
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
    text = re.sub("```.*?```", "", section(title, page), flags=re.S)
    numbers = re.findall(r"(?<!Figure )(?<![\w.,])(-?\d+\.\d+|\d+(?= %))", text)
    missing = [number for number in numbers if float(number) not in values.round(len(number.partition(".")[2]))]
    assert missing == [] and len(numbers) > 1


def notebook(name):
    """The text of a notebook in one line."""
    (path,) = (ROOT / "notebooks").glob(f"{name}_*.ipynb")
    cells = nbformat.read(path, as_version=4).cells
    return " ".join(" ".join(cell.source for cell in cells if cell.cell_type == "markdown").split())


def test_up_to_how_many_cells_seeds_agree_is_that_of_the_table():
    sizes = dict(list(read_table("beyond/sizes").groupby("task")))
    goal, car, pendulum = (largest_alike(sizes[task]) for task in ("SimpleGoal", "MountainCar", "Pendulum"))
    assert f"up to {goal} cells on SimpleGoal, {car} on MountainCar and {pendulum} on Pendulum" in RESULTS_LINE


def test_episodes_that_the_text_compares_are_those_of_the_table():
    table = read_table("beyond/budgets").set_index(["task", "method"])
    episodes = table["teacher"].unstack("task")
    times = episodes.loc["our cells, faithful"] / episodes.loc["our cells, tuned"]
    said = f"{times.min():.0f} to {times.max():.0f} times as many episodes of the teacher"
    assert said in notebook("06") and said in notebook("09")


def test_how_far_mountaincar_is_from_the_paper_is_that_of_the_ledger():
    row, said = read_table("ledger", index_col="id"), notebook("05")
    teacher = row["here"]["mc_drl_mean"] - row["value"]["mc_drl_mean"]
    implied = quartiles_from_fences(row["value"]["mc_ours_whisker_low"], row["value"]["mc_ours_whisker_high"])
    rerun = [row["here"][f"mc_spread_ours_{name}"] for name in ("q1", "q3")]
    (below,) = {round(here - there, 1) for here, there in zip(rerun, implied, strict=True)}
    assert f"returns {teacher:.2f} more than the paper's." in said and 0.4 < teacher / below < 0.55
    assert f"lie {below} below the rerun's" in said
