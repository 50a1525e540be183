"""The tables of `vsp.paper` against a second transcription of the paper, typed apart from them: golden/printed_*."""

import re
from pathlib import Path

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL

from vsp.paper.printed import PREFIX, SHORT, linear_policies, printed_spread, printed_text_numbers, published_policy

GOLDEN = Path(__file__).parents[1] / "golden"
NAMES = {SIMPLEGOAL: "simplegoal", MOUNTAINCAR: "mountaincar"}
METRICS = ["Min", "Max", "Mean", "Std", "Q1", "Median/Q2", "Q3", "IQR", "Coverage"]


def lines(file, place):
    """The fields, but for the first, of the lines of `file` whose first field is `place`."""
    text = (GOLDEN / file).read_text(encoding="utf-8")
    rows = [line.split("\t") for line in text.splitlines() if not line.startswith("#")]
    return [fields for first, *fields in rows if first == place]


def printed_policy(task):
    """The codewords, colours (None where the paper has none) and expressions, one tuple of these per output."""
    columns = list(zip(*lines("printed_linear_policies.txt", f"appendix:{NAMES[task]}_functions"), strict=True))
    colours = columns.pop(1) if task == MOUNTAINCAR else None
    return columns[0], colours, columns[1:]


def parse_codeword(text):
    """[0.891, 0.628] as its two numbers."""
    return [float(number) for number in re.fullmatch(r"\[(-?\d\.\d+), (-?\d\.\d+)\]", text).groups()]


def parse_expression(text, inputs):
    """-0.148x-0.021y-0.055 as its factors in the order of `inputs` and its constant; 0 where there is no such term."""
    terms = re.findall(r"([-+]?\d+\.\d+)([a-z]?)", text)
    assert "".join(number + name for number, name in terms) == text, f"cannot parse {text!r}"
    found = {name: float(number) for number, name in terms}
    assert len(found) == len(terms) and set(found) <= {*inputs, ""}, f"cannot parse {text!r}"
    return [found.get(name, 0.0) for name in [*inputs, ""]]


@pytest.mark.parametrize(
    ("task", "cells", "inputs", "outputs"), [(SIMPLEGOAL, 13, "xy", ["dx", "dy"]), (MOUNTAINCAR, 32, "xv", ["F"])]
)
def test_linear_policies_are_the_printed_ones(task, cells, inputs, outputs):
    codewords, colours, expressions = printed_policy(task)
    frame, policy = linear_policies(task), published_policy(task)
    assert len(codewords) == len(frame) == cells and len(expressions) == len(outputs)

    numbers = np.array([parse_codeword(text) for text in codewords])  # (k, d)
    np.testing.assert_array_equal(policy.codewords, numbers, strict=True)
    assert policy.metric == "manhattan" and (policy.scale == 1).all() and policy.policy_class.name == "linear"
    np.testing.assert_array_equal(frame[[f"codeword_{name}" for name in inputs]].to_numpy(), numbers, strict=True)

    per_output = [np.array([parse_expression(text, inputs) for text in column]) for column in expressions]
    np.testing.assert_array_equal(policy.coefficients, np.stack(per_output, axis=-1), strict=True)  # (k, d + 1, m)
    for output, numbers, column in zip(outputs, per_output, expressions, strict=True):
        held = frame[[f"{output}_{name}" for name in [*inputs, "bias"]]].to_numpy()
        np.testing.assert_array_equal(held, numbers, strict=True)
        assert frame[f"{output}_printed"].tolist() == list(column)
    assert (colours and list(colours)) == (frame["colour"].tolist() if "colour" in frame else None)
    places = [f"(appendix:{NAMES[task]}_functions), row {row}" for row in range(1, cells + 1)]
    assert all(where.endswith(place) for where, place in zip(frame["where"], places, strict=True))


@pytest.mark.parametrize(("key", "count"), [("box plot", 4), ("Performance", 21)])
@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR])
def test_text_numbers_are_the_printed_ones(task, key, count):
    """Both ways: every printed number has a row of its own, and every row of that place is a printed number."""
    first = f"{SHORT[task]} Performance" if key == "Performance" else f"fig:{NAMES[task]}_boxplots caption"
    printed = [(*label.split(), text) for text, label in lines("printed_numbers.txt", first)]
    frame = printed_text_numbers()
    frame = frame[(frame["task"] == task) & frame["where"].str.contains(key)]
    held = list(zip(frame.index, frame["subject"], frame["printed"], strict=True))
    assert len(printed) == count
    asked = [(f"{PREFIX[task]}_{id}", who, text.replace("No", "no")) for who, id, text in printed]
    assert sorted(held) == sorted(asked)


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR])
def test_spread_is_the_printed_one(task):
    frame = printed_spread(task)
    rows = lines("printed_numbers.txt", f"appendix:{NAMES[task]}_spread")
    assert [label for _, label in rows] == [f"{who} in row {metric}" for metric in METRICS for who in ("DRL", "Ours")]
    assert frame.index.tolist() == METRICS
    printed = [text for text, _ in rows]
    assert frame[["drl", "ours"]].to_numpy().ravel().tolist() == [float(text.removesuffix("%")) for text in printed]
    units = frame["unit"].repeat(2)
    assert [unit == "percent" for unit in units] == [text.endswith("%") for text in printed]
