import pytest
from support import MOUNTAINCAR, SIMPLEGOAL

from vsp.paper import audit
from vsp.paper import printed as printed_module
from vsp.paper.printed import _read, linear_policies, printed_values

TASK = {"sg": SIMPLEGOAL, "mc": MOUNTAINCAR}
HOLDS, CONTRADICTS, OPEN = audit.VERDICTS

VERDICTS = {
    "Number of distilled policies": CONTRADICTS,
    "SimpleGoal: coverage and outliers of the distilled policies": CONTRADICTS,
    "SimpleGoal: the caption on spread and performance": CONTRADICTS,
    "MountainCar: quartiles of the distilled policies, in table and text": CONTRADICTS,
    "The same rule for outliers in every column": OPEN,
    "SimpleGoal: what the teacher's outliers are": HOLDS,
    "SimpleGoal: the border, and what goal and pit pay": OPEN,
    "Published policies: coefficients rounded to four digits": CONTRADICTS,
    "Dimensions of states and actions": CONTRADICTS,
    "Which iterations may change the partition": CONTRADICTS,
}
IN_DOUBT = {
    "sg_text_policies", "mc_text_policies", "sg_spread_ours_coverage", "mc_spread_ours_q1", "mc_spread_ours_median",
    "mc_spread_ours_q3", "mc_spread_ours_iqr", "sg_table_digits", "mc_table_digits", "action_dimensions",
}  # fmt: skip


@pytest.fixture(scope="module")
def found():
    return {finding.title: finding for finding in audit.audit_findings()}


@pytest.fixture
def alter(monkeypatch):
    """Print other numbers: alter({id: text}), for ids of the text and of T5 and T6."""

    def change(printed):
        read = _read

        def altered(file, numbers=None):
            frame = read(file, numbers)
            for id, text in printed.items():
                as_read = float(text) if numbers else text
                if file == "text_numbers.csv" and "_spread_" not in id:
                    frame.loc[frame["id"] == id, ["value", "printed"]] = [as_read, text]
                elif file == "spread.csv" and "_spread_" in id:
                    task, (subject, metric) = TASK[id[:2]], id[len("sg_spread_") :].split("_")
                    row = (frame["task"] == task) & frame["metric"].str.lower().str.startswith(metric)
                    assert row.sum() == 1
                    frame.loc[row, subject] = as_read
            return frame

        monkeypatch.setattr(printed_module, "_read", altered)

    return change


# The findings


def test_verdicts(found):
    assert {title: finding.verdict for title, finding in found.items()} == VERDICTS


def test_what_is_in_doubt_exists(found):
    assert audit.in_doubt() == IN_DOUBT
    assert IN_DOUBT <= set(printed_values()["id"])


@pytest.mark.parametrize(
    ("title", "numbers"),
    [
        ("Number of distilled policies", ["SimpleGoal: 85 and 40", "80022", "MountainCar: 40 and 85", "40026"]),
        # 11067/85000 = 0.13020; 0.1383 * 85000 = 11755.5; 11067/0.1383 = 80022, that is 80 policies
        (
            "SimpleGoal: coverage and outliers of the distilled policies",
            ["86.98 %", "86.17 %", "1175", "80000 episodes", "68933", "73933"],
        ),
        # (94.130 - 93.313)/4 = 0.20425; 93.313 + 1.5 * 0.20425 = 93.619375; 93.403 - 1.5 * 0.145 = 93.1855
        (
            "MountainCar: quartiles of the distilled policies, in table and text",
            ["Q1 93.619", "Q3 93.824", "IQR 0.204", "93.186 and 93.76", "36870", "93.731", "to 93.643", "0.133 (0.222"],
        ),
        # 16.599 - 2 * 3.117 = 10.365; 12.657 - 2 * 8.436 = -4.215; 12.298 - 1.5 * 5.348 = 4.276
        (
            "The same rule for outliers in every column",
            ["10.364", "10.365", "1.192", "4.276", "-4.215", "93.331", "90.844"],
        ),
        # (24 * 8.369 + 20)/22 = 10.0389; 0.2 * 0.2 * 1000 = 40
        ("SimpleGoal: what the teacher's outliers are", ["24 = 2 at -10 and 22 with mean 10.04", "40 of 1000"]),
        # 13 * 2 + 13 * 6 - 2 numbers in T3, 32 * 5 in T4
        ("Published policies: coefficients rounded to four digits", ["Of 262 numbers 6 have 4 decimals (all 2 to 4)"]),
        ("Dimensions of states and actions", ["[2, 2]", "[2, 1]"]),
        ("Which iterations may change the partition", ["4000, 1000, 5000 - 20 = 4980", "1600, 400, 2000 - 50 = 1950"]),
    ],
)
def test_key_numbers_by_hand(found, title, numbers):
    assert found[title].printed and "nan" not in f"{found[title].printed} {found[title].arithmetic}".split()
    for number in numbers:
        assert number in found[title].arithmetic, (number, found[title].arithmetic)


QUARTILES = {"q1": "93.619", "median": "93.74", "q3": "93.824", "iqr": "0.204"}
QUARTILES = {f"mc_spread_ours_{name}": text for name, text in QUARTILES.items()}


@pytest.mark.parametrize(
    ("title", "numbers", "verdict"),
    [
        ("Number of distilled policies", {"sg_text_policies": "85", "mc_text_policies": "40"}, HOLDS),
        ("SimpleGoal: coverage and outliers of the distilled policies", {"sg_spread_ours_coverage": "86.98"}, HOLDS),
        ("MountainCar: quartiles of the distilled policies, in table and text", QUARTILES, HOLDS),
        ("SimpleGoal: the caption on spread and performance", {"sg_spread_ours_std": "5.9"}, HOLDS),
        ("The same rule for outliers in every column", {"sg_drl_outliers_max": "8.0"}, HOLDS),
        ("SimpleGoal: what the teacher's outliers are", {"sg_drl_outliers_std": "4.5"}, OPEN),
    ],
)
def test_another_number_another_verdict(found, alter, title, numbers, verdict):
    check = dict(zip(found, audit.CHECKS))[title]
    alter(numbers)
    finding = check()
    assert finding.title == title and finding.verdict == verdict != VERDICTS[title]


def test_other_tables_other_verdicts(monkeypatch):
    def put(name, other):
        monkeypatch.setattr(printed_module, name, lambda *task: other)

    values, policies = printed_values(), linear_policies(MOUNTAINCAR)
    cells = values["id"].str.contains("_cell_")
    values.loc[cells, "paper"] = values.loc[cells, "value"].map("{:.4f}".format)
    put("printed_values", values)
    assert audit.printed_digits().verdict == HOLDS
    put("linear_policies", policies.assign(G_printed=policies["F_printed"]))
    assert audit.dimensions().verdict == HOLDS
    put("printed_hyperparameters", {"n_epochs": 8, "n_split": 4, "n_freeze": 4})
    assert audit.frozen_iterations().verdict == HOLDS
