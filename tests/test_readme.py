"""The README and docs/: examples run, links lead somewhere, and what is quoted equals the tables."""

import functools
import io
import math
import pydoc
import re
import subprocess

import pandas as pd
import pytest

from studies.comparison import ablation, all_rows, largest_alike, method_summary, read_results
from vsp.paper import quartiles_from_fences
from vsp.run.atomic import ROOT
from vsp.run.notebook import nbformat

PAGES = [ROOT / "README.md", ROOT / "data" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
README = PAGES[0].read_text("utf-8")
RESULTS = (ROOT / "docs" / "results.md").read_text("utf-8")


def test_python_example_runs(tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    monkeypatch.chdir(tmp_path)
    example = example.replace("Dock-v0", "DockOfReadme-v0")  # other tests have a Dock-v0 of their own
    exec(compile(example, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "push east = -1.50" in said and "action within the limits: push east" in said  # as the pilot's
    assert (tmp_path / "my_policy.vsp").exists()


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


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_names_exist(page):
    text = page.read_text("utf-8")
    assert [
        name for name in re.findall(r"`((?:vsp|vsp_beyond|studies)(?:\.\w+)+)", text) if pydoc.locate(name) is None
    ] == []
    assert [path for path in re.findall(r"`((?:vsp|tests|\.ci)/[\w/.]*)`", text) if not (ROOT / path).exists()] == []


def test_artefacts_and_cells_exist():
    cells = {
        path.stem[:2]: {cell.id for cell in nbformat.read(path, as_version=4).cells}
        for path in (ROOT / "notebooks").glob("*.ipynb")
    }
    page = (ROOT / "docs" / "artefacts.md").read_text("utf-8")
    rows = re.findall(r"^\| [^|]* \| ([^|]*) \| (\d\d), ([^|]*) \|$", page, flags=re.M)
    assert {notebook for _, notebook, _ in rows} == set(cells)
    for artefacts, notebook, names in rows:
        assert set(re.findall(r"`([^`]+)`", names)) <= cells[notebook]
        for artefact in re.findall(r"`([a-z_/]+)`", artefacts):
            assert list((ROOT / "figures").glob(f"{artefact}.*")), artefact


def test_the_api_has_every_module():
    """But those of the course, which checks answers."""
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs" / "api").glob("*.md"))
    shown = set(re.findall(r"automodule:: ([\w.]+)", pages))
    parts = ("vsp", "vsp_beyond", "studies")
    paths = [path.relative_to(ROOT) for part in parts for path in (ROOT / part).rglob("*.py")]
    assert shown == {".".join(path.with_suffix("").parts) for path in paths if not path.name.startswith("_")}


# Quoted results


def table_text(name):
    """figures/tables/NAME.csv as the pages quote it: as committed, where a machine of another type wrote over it."""
    folder, _, stem = name.rpartition("/")
    path = f"figures/{folder}/tables/{stem}.csv".replace("//", "/")
    return _committed(path) if _made_on_another_type() else (ROOT / path).read_text("utf-8")


def read_table(name, **options):
    return pd.read_csv(io.StringIO(table_text(name)), **options)


@functools.cache
def _made_on_another_type():
    path = "data/results/made_on.txt"
    return (ROOT / ".git").exists() and _committed(path) != (ROOT / path).read_text("utf-8")


def _committed(path):
    run = subprocess.run(["git", "-C", ROOT, "show", f"HEAD:{path}"], capture_output=True, check=True)
    return run.stdout.decode()


def quoted(text):
    """Whether the README says `text`, wherever its lines break."""
    return " ".join(text.split()) in " ".join(README.split())


def test_numbers_of_the_readme_are_those_of_the_tables():
    cells = read_table("what_cells_buy").set_index(["task", "policy"])
    failing = cells["failing"]["SimpleGoal-v0"]
    assert quoted(f"13 constants misses the goal in {failing['tree, 13 leaves']:.1%}".replace("%", " %"))
    assert quoted(f"the distilled policies in {failing['distilled, all runs']:.1%}".replace("%", " %"))
    assert quoted(f"in the same cells, in {failing['same cells, least squares']:.1%}".replace("%", " %"))
    spread = read_table("simplegoal_spread", index_col="metric").loc["Mean"]
    assert quoted(f"return {spread.iloc[3]:.2f}, the paper prints {spread.iloc[2]:.2f}")


def test_faithful_policies_are_those_of_the_table():
    table = read_table("beyond/faithful").set_index("task")
    tasks = table.to_dict("index")
    both = [f"{round(own['both'] * own['policies'])}" for own in tasks.values()]
    assert quoted("return as much, in all 20 seeds:") and both[:3] == ["20"] * 3
    assert list(table["policies"]) == [20, 20, 20, 10]
    first, *others, lander = tasks.values()
    assert quoted(f"{first['at most']} cells reproduce {first['r2']:.0%}".replace("%", " %"))
    for own, task in zip(others, ("MountainCar", "Pendulum")):
        assert quoted(f"{own['at most']} cells {own['r2']:.0%} on {task}".replace("%", " %"))
    share = f"{100 * lander['r2']:.0f} %"
    assert quoted(f"LunarLander {lander['at most']} cells reproduce only {share}")
    assert lander["good"] == 0.9 and "returns in nine of ten seeds, and" in " ".join(RESULTS.split())
    teachers = read_table("beyond/headline").set_index("task")["teacher"]
    pattern = r"^\| (\w+) \| (\d+) \| (0\.\d{3}) \| ([-\d.]+) \| ([-\d.]+) \| (\d+) of (\d+) \| ([\d.]+) \|$"
    assert re.findall(pattern, RESULTS, flags=re.M) == [
        (task, f"{own['at most']}", f"{own['r2']:.3f}", f"{own['mean']:.2f}", f"{teachers[task]:.2f}", good,
         f"{own['policies']}", f"{own['index']:.2f}")
        for good, (task, own) in zip(both, tasks.items())
    ]  # fmt: skip


def test_who_leads_is_that_of_the_table():
    table = read_table("beyond/leaders").set_index(["task", "size"])
    two = table.loc[("MountainCar", 2)]
    assert quoted(f"of a line return {two['rival mean']:.2f}, two of our cells {two['mean']:.2f}")
    said = f"{two['rival mean']:.2f} on average: a policy of two cells, too, but our search ends at {two['mean']:.2f}"
    assert said in " ".join(RESULTS.split())
    assert two["rival"] == "oblique tree, constants"
    best = read_table("beyond/limit_sizes").set_index(["task", "size"])["mean"]["MountainCar", 3]
    assert quoted(f"Distilled from the best policy and tuned longer, three return {best:.2f}.")
    assert set(table.loc["SimpleGoal", "ahead"]) == set(table.loc["LunarLander", "ahead"]) == {"level"}
    assert (table["ahead"] != "ours").all() and "our cells have a certain lead on no task" in " ".join(RESULTS.split())
    means = read_table("beyond/equal").set_index(["task", "size", "method"])["mean"]
    lander, constants = means["LunarLander"], means["MountainCar", 4, "oblique tree, constants"]
    said = f"one linear map returns {lander[1, 'one linear map']:.1f}, two of our cells {lander[2, 'our cells']:.1f}"
    assert said in " ".join(RESULTS.split()) and f"constant leaves returns {constants:.2f})" in notebook("09")
    rows = all_rows("MountainCarContinuous-v0").set_index(["method", "size"])["mean"]
    seeds = rows["oblique tree, constant leaves, DAgger, tuned", 2]
    assert f"on average ({seeds.min():.1f} to {seeds.max():.1f} in seven seeds)" in notebook("06") and len(seeds) == 7


def test_how_like_the_teacher_trees_are_is_that_of_the_rows():
    apart = read_table("beyond/apart").query("task == 'SimpleGoal'").set_index("method")["r2 4"]
    tree, cells = apart["oblique tree, greedy fit"], apart["our cells, greedy fit"]
    assert f"a tree reaches {tree:.3f}, and cells {cells:.3f}, with four" in " ".join(RESULTS.split())
    lander = all_rows("LunarLanderContinuous-v3").groupby(["method", "size"])["r2"].median().drop("teacher")
    best = lander["oblique tree, linear leaves, DAgger", 32]
    said = f"with 32 linear leaves reproduces {100 * best:.0f} % (on fewer states), more than any other row"
    assert said in " ".join(RESULTS.split()) and best == lander.max()


def test_how_often_faithful_landers_fail_is_that_of_the_table():
    tail = read_table("beyond/tail").set_index(["method", "size"])["failing"]
    faithful, teacher = (1000 * tail[about] for about in (("our cells, faithful", 8), ("teacher", 0)))
    said = f"{faithful:.0f} landings in a thousand fail, {teacher:.0f} of the teacher's"
    others = tail[tail.index.get_level_values("method") != "our cells, faithful"]
    assert said in " ".join(RESULTS.split()) and 1000 * others.max() <= teacher


def test_up_to_how_many_cells_seeds_agree():
    sizes = read_table("beyond/sizes")
    found = [largest_alike(sizes[sizes["task"] == task]) for task in ("SimpleGoal", "MountainCar", "Pendulum")]
    said = f"with up to {found[0]} cells on SimpleGoal, {found[1]} on MountainCar and {found[2]} on Pendulum"
    assert said in " ".join(RESULTS.split())


def test_counts_of_the_readme_are_those_of_the_ledger():
    counts = read_table("ledger").groupby("part")["verdict"].value_counts()
    (results, of), (settings, of_settings) = (
        (found["reproduced"], found["reproduced"] + found["differs"])
        for found in (counts["results"], counts["settings"])
    )
    book = read_table("ledger")
    wide = (book["wide"] & (book["verdict"] == "reproduced") & (book["part"] == "results")).sum()
    assert quoted(f"{results} of {of} checkable results reproduce** ({wide} with a wide interval)")
    assert quoted(f"and {settings} of {of_settings} settings. On")
    counted = f"{results} of {of} checkable results reproduce, {wide} of them with a wide interval"
    assert counted in " ".join(RESULTS.split())
    checked = book[(book["part"] == "results") & book["verdict"].isin(["reproduced", "differs"])]
    once = checked.drop_duplicates(["task", "subject", "value"])
    again = f"{of - len(once)} of these results again, mostly in a table after the text; if each counts once, "
    again += f"{(once['verdict'] == 'reproduced').sum()} of {len(once)} reproduce."
    assert again in " ".join(RESULTS.split())
    assert quoted(f"contradicts itself in {counts[:, 'contradicts itself'].sum()} values")


def test_results_are_those_of_the_tables():
    tables = {name: read_table(f"{name.lower()}_spread", index_col="metric") for name in ("SimpleGoal", "MountainCar")}
    rows = re.findall(r"^\| (SimpleGoal|MountainCar), ([a-z]+)[^|]* \| (.*) \|$", RESULTS, flags=re.M)
    assert len(rows) == 8
    for task, metric, cells in rows:
        expected = tables[task].rename(index={"Median/Q2": "Median"}).loc[metric.capitalize()]
        assert cells.split(" | ") == [f"{value:.3f}" for value in expected]


def test_ledger_counts_are_those_of_the_ledger():
    book = read_table("ledger")
    verdicts = ["reproduced", "differs", "cannot be checked", "contradicts itself"]
    names = {"settings": "settings and counts", "results": "results", "coefficients": "coefficients[^|]*"}
    for part, name in names.items():
        (cells,) = re.findall(rf"^\| {name} \| (.*) \|$", RESULTS, flags=re.M)
        found = book.loc[book["part"] == part, "verdict"].value_counts()
        assert [int(n) for n in cells.split(" | ")] == [found.get(verdict, 0) for verdict in verdicts]


def test_headline_is_that_of_the_table():
    pattern = r"^\| (\w+) \| ([-\d.]+) \| (\d+) \| ([-\d.]+) \| (\d+) % \| ([-\d.]+) \| (\d+) % \|$"
    assert re.findall(pattern, RESULTS, flags=re.M) == [
        (row["task"], f"{row['teacher']:.2f}", f"{row['cells']}", f"{row['mean']:.2f}", f"{100 * row['reached']:.0f}",
         f"{row['rival mean']:.2f}", f"{100 * row['rival reached']:.0f}")
        for row in read_table("beyond/headline").to_dict("records")
    ]  # fmt: skip


def test_what_is_found_without_a_teacher_is_that_of_the_table():
    names = {"SimpleGoal": "SimpleGoal-v0", "Pendulum": "Pendulum-v1"}
    parts = {title: ablation(all_rows(task)).set_index("part")["mean"] for title, task in names.items()}
    lander = method_summary(all_rows("LunarLanderContinuous-v3")).set_index(["method", "size"])["mean"]
    pattern = r"SimpleGoal \(([\d.]+)\), and fail on Pendulum \((-[\d.]+)\) and LunarLander \(([\d.]+)\)"
    (text,) = re.findall(pattern, RESULTS)
    found = parts["SimpleGoal"]["no teacher"], parts["Pendulum"]["no teacher"], lander["our cells, no teacher", 4]
    assert text == tuple(f"{mean:.2f}" for mean in found)
    said = " ".join(RESULTS.split())
    assert f"one linear map per engine, tuned by our method, returns {lander['our cells, tuned', 1]:.2f}" in said


def test_the_printed_policy_is_that_of_the_table():
    table = table_text("beyond/pendulum_policy")
    (block,) = re.findall(r"```text\n(Pendulum-v1: .*?)```", RESULTS, flags=re.S)
    cells = re.findall(r"^nearest to (.*):\n  τ = (.*)$", block, flags=re.M)
    for row, (codeword, equation) in zip(table.splitlines()[1:], cells, strict=True):
        found, printed = (
            re.findall(r"-?\d+\.?\d*", text.replace("- ", "-")) for text in (row, f"{codeword} {equation}")
        )
        assert found == printed


def test_what_cells_buy_is_that_of_the_table():
    table = read_table("what_cells_buy")
    block = RESULTS.partition("### What do the cells buy?")[2]
    rows = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", block, flags=re.M)
    shown = {tuple(row[1:3]) for row in rows}, {tuple(row[3:]) for row in rows}
    for (_, kinds), found in zip(table.groupby("task", sort=False), shown, strict=True):
        kinds = kinds.to_dict("records")
        assert found == {(f"{row['mean']:.2f}", f"{100 * row['failing']:.1f}") for row in kinds}


def test_what_is_said_to_be_certain_is_in_its_tables():
    block = " ".join(RESULTS.partition("## What is certain?")[2].partition("\n## ")[0].split())
    rows = pd.read_csv(ROOT / "data/beyond/proofs.csv").set_index("name")
    paper, one, tuned, margin, car = (
        rows.loc[name]
        for name in (
            "simplegoal_paper",
            "simplegoal_one_map",
            "simplegoal_tuned",
            "simplegoal_margin",
            "mountaincar_limit",
        )
    )
    three, explore = rows.loc["simplegoal_simplified"], (ROOT / "docs/explore.md").read_text("utf-8")
    told = f"fail from {100 * three['pit']:.2f} % of all starts, the paper's thirteen from {100 * paper['pit']:.2f} %"
    assert told in " ".join(explore.split()) and three["cells"] == 3
    assert f"pit from {paper['pit']:.4%}".replace("%", " %") in block and f"map from {one['pit']:.4%}"[:-1] in block
    assert tuned["program"] == margin["program"] == 1.0 and (tuned["cells"], margin["cells"]) == (4, 3)
    assert f"goal within {tuned['program_steps']:.0f} steps" in block
    assert f"same within {margin['program_steps']:.0f} steps" in block
    assert f"off by {margin['disturbance']:.4f}" in block
    assert f"({car['n_states']:,.0f} states after the first step) and returns at least {car['least']:.3f}" in block
    assert pd.read_csv(ROOT / "data/beyond/proofs_reals.csv")["share"].item() == 1.0
    for name in ("grid", "teacher"):
        share = pd.read_csv(ROOT / f"data/beyond/proofs_{name}.csv")["share"].iloc[-1]
        assert f"from {math.floor(1e4 * share) / 100:.2f} % of the starts" in block


def test_what_is_said_of_the_limit_is_in_its_tables():
    block = RESULTS.partition("## How good can a few cells be?")[2].partition("\n## ")[0]
    best, sizes, starts, robots = (
        pd.read_csv(ROOT / f"figures/beyond/tables/limit_{name}.csv")
        for name in ("references", "sizes", "starts", "robots")
    )
    known = {row.task: f"{row.best:.3f} | {row.teacher:.3f}" for row in best.itertuples()}
    teachers = pd.read_csv(ROOT / "figures/beyond/tables/headline.csv").set_index("task")["teacher"]
    known["LunarLander"] = f"not known | {teachers['LunarLander']:.2f}"
    cells = {"SimpleGoal": 4, "MountainCar": 3, "Pendulum": 8, "LunarLander": 3}
    for row in sizes[[cells[row.task] == row.size for row in sizes.itertuples()]].itertuples():
        near = f"{row.near * row.policies:.0f} of {row.policies}"
        assert f"| {row.task} | {known[row.task]} | {row.size} | {row.mean:.3f} | {near} |" in block
    robots, said = robots.set_index(["task", "method", "size"]), " ".join(block.split())
    longer, many = (f"{row.mean:.3f} ({row.low:.2f} to {row.high:.2f}" for row in starts[1:3].itertuples())
    assert f"generations reach {longer}), and twelve initial policies {many}; three seeds each)" in said
    assert (starts["policies"][1:3] == 3).all()
    proved = read_results("proofs").set_index("name")["mean_low"]
    simplegoal, car = (f"{proved[f'{task}_limit']:.3f}" for task in ("simplegoal", "mountaincar"))
    # The mean of max(10, 10 d + 9) over the unit square, by integration; notebook 07 sums over small squares
    possible = 10 * (math.sqrt(2) + math.asinh(1)) / 3 + 9 + math.pi / 1200
    assert f"return {simplegoal} (the best possible: {possible:.3f}), and one of MountainCar {car}." in said
    failing = {row.task: f"{100 * row.failing:.2f} %" for row in sizes.itertuples() if cells[row.task] == row.size}
    assert f"at most {failing['SimpleGoal']} on SimpleGoal and {failing['LunarLander']} on LunarLander" in said
    walker, cheetah, ours = robots.loc["BipedalWalker"], robots.loc["HalfCheetah"], "cells, trained further"
    map_, teacher, tree = "one map, random search", "robot's teacher", cheetah.loc[("oblique tree, trained further", 8)]
    one, eight, sixteen = (cheetah.loc[(ours, k)] for k in (1, 8, 16))
    large = cheetah.loc[("oblique tree, trained further", 16)]
    assert f"are, returns {tree['mean']:.0f}, {100 * tree['share']:.0f} % of its teacher's return" in said
    assert f"eight cells {eight['mean']:.0f} ({100 * eight['share']:.0f} %)" in said
    assert f"Sixteen leaves return {large['mean']:.0f} ({100 * large['share']:.0f} %), sixteen cells" in said
    assert f"cells {sixteen['mean']:.0f} ({100 * sixteen['share']:.0f} %)" in said
    assert f"one cell returns {one['mean']:.0f}." in said and eight["most"] < tree["least"]
    assert f"random search, returns {cheetah['mean'][map_, 0]:.0f}." in said and sixteen["most"] < large["least"]
    assert cheetah["high"][map_, 0] < eight["low"] and cheetah["policies"][map_, 0] == eight["policies"] == 5
    fives = [(map_, 0), *((kind + more, 8) for kind in ("cells", "oblique tree") for more in ("", ", trained further"))]
    others = robots["policies"].drop([("HalfCheetah", *row) for row in fives])
    assert (others[others.index.get_level_values("method") != teacher] == 3).all()
    assert eight["high"] < tree["low"] and tree["policies"] == 5
    alone = walker.loc[("oblique tree", 4)]
    cells_alone = walker["mean"]["cells", 8]
    assert f"by imitation alone it returns {alone['mean']:.1f}, and eight cells {cells_alone:.1f}." in said
    assert alone["least"] > 300 and alone["share"] > 1
    two, played = walker.loc[(ours, 2)], walker["mean"][teacher, 0]
    least = math.floor(10 * two["least"]) / 10  # rounded down: "at least" must hold
    two_cells = f"they return {two['mean']:.1f}, at least {least} with each of three seeds"
    assert f"{two_cells} (interval {two['low']:.1f} to {two['high']:.1f}); its teacher returns {played:.1f}." in said
    assert two["least"] > 0.98 * played
    search = walker.loc[(map_, 0)]
    assert f"returns {search['most']:.0f} in the best of three searches and {search['mean']:.1f} on average" in said
    longer = walker.loc[("one map, longer search", 0)]
    others = (3 * longer["mean"] - longer["most"]) / 2
    assert f"returns {longer['most']:.0f}, the other two {others:.0f}." in said and longer["most"] > played
    likeness = f"to {eight['r2']:.2f} on HalfCheetah and {walker['r2'][ours, 8]:.2f} on BipedalWalker."
    assert f"lowers R²: with eight cells {likeness}" in said


def notebook(name):
    """The text of a notebook in one line."""
    (path,) = (ROOT / "notebooks").glob(f"{name}_*.ipynb")
    cells = nbformat.read(path, as_version=4).cells
    return " ".join(" ".join(cell.source for cell in cells if cell.cell_type == "markdown").split())


def test_episodes_that_the_text_compares_are_those_of_the_table():
    table = read_table("beyond/budgets").set_index(["task", "method"])
    seen, tuning = table["teacher"].unstack("task"), table["tuning"].unstack("task")
    times = seen.loc["our cells, faithful"] / seen.loc["our cells"]
    said = f"{times.min():.0f} to {times.max():.0f} times as many episodes of the teacher"
    for text in (" ".join(RESULTS.split()), notebook("06"), notebook("09")):
        assert said in text
    more = tuning.loc["our cells, tuned"] / tuning.filter(regex="axis tree.*tuned", axis=0).min()
    assert f"our cells get up to {more.max():.1f} times as many as an axis tree" in notebook("06")


def test_how_far_mountaincar_is_from_the_paper_is_that_of_the_ledger():
    row, said = read_table("ledger", index_col="id"), notebook("05")
    teacher = row["here"]["mc_drl_mean"] - row["value"]["mc_drl_mean"]
    implied = quartiles_from_fences(row["value"]["mc_ours_whisker_low"], row["value"]["mc_ours_whisker_high"])
    ours = [row["here"][f"mc_spread_ours_{name}"] for name in ("q1", "q3")]
    below = [round(mine - theirs, 1) for mine, theirs in zip(ours, implied, strict=True)]
    assert f"returns {teacher:.2f} more than the paper's." in said and 0.4 < teacher / below[0] < 0.55
    assert below[0] == below[1] and f"lie {below[0]} below the rerun's" in said
