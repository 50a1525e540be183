import dataclasses

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, same_arrays

from vsp import store
from vsp.baselines import refit
from vsp.config import Refinement
from vsp.crowd import Crowd
from vsp.envs import get_task
from vsp.geometry import distances
from vsp.measure import cost
from vsp.policy import VoronoiPolicy
from vsp.refine import refine
from vsp.simplify import prune, rounded
from vsp.store import DamagedFile
from vsp.subpolicies import expression, form_of


def random_policy(k=6, *, seed=0, task=SIMPLEGOAL, **options):
    rng, task = np.random.default_rng(seed), get_task(task)
    d, m = len(task.low), len(task.action_low)
    codewords = rng.uniform(task.low, task.high, size=(k, d))
    return VoronoiPolicy(codewords, rng.normal(size=(k, d + 1, m)), task=task, **options)


TWO = VoronoiPolicy(  # cells left and right; the right one answers constants, one of them beyond the limits
    [[0.0, 0.5], [1.0, 0.5]], [[[1, 0], [0, 2], [0.25, -0.5]], [[0, 0], [0, 0], [3, -0.5]]], task=SIMPLEGOAL
)


# predict


def test_predict_by_hand():
    action, state = TWO.predict(np.array([0.25, 0.5]))
    assert state is None and action.tolist() == [0.5, 0.5]  # x + 0.25, 2 y - 0.5
    assert TWO.predict(np.array([0.75, 0.5]))[0].tolist() == [1.0, -0.5]
    assert TWO.linear(np.array([0.75, 0.5])).tolist() == [3.0, -0.5]
    assert TWO.predict(np.array([[0.5, 0.5]]))[0].tolist() == [[0.75, 0.5]]  # a tie goes to the lower index


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR, PENDULUM, LUNARLANDER])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_batch_is_its_rows(task, dtype):
    policy, task = random_policy(20, task=task), get_task(task)
    obs = np.random.default_rng(1).uniform(task.low, task.high, size=(300, len(task.low))).astype(dtype)
    actions, _ = policy.predict(obs)
    assert actions.shape == (300, len(task.action_low)) and actions.dtype == np.float64
    single = [policy.predict(row)[0] for row in obs]
    assert single[0].shape == (len(task.action_low),) and np.array_equal(actions, single)
    assert (actions >= task.action_low).all() and (actions <= task.action_high).all()
    assert (actions == task.action_high).any() and (actions == task.action_low).any()
    assert policy.cells(obs).tolist() == [policy.cells(row) for row in obs]
    assert np.array_equal(actions, np.clip(policy.linear(obs), task.action_low, task.action_high))


def test_predict_uses_the_map_of_the_cell():
    policy = random_policy(30)
    obs = np.random.default_rng(2).random((200, 2))
    for row, cell in zip(obs, policy.cells(obs)):
        weights, bias = policy.coefficients[cell, :-1], policy.coefficients[cell, -1]
        assert np.allclose(policy.linear(row), row @ weights + bias, atol=1e-12)
        assert cell == distances(row[None], policy.codewords)[0].argmin() == policy.cells(row)


def test_an_empty_batch_and_a_list():
    assert TWO.predict(np.zeros((0, 2)))[0].shape == (0, 2)
    assert TWO.predict([0.25, 0.5])[0].tolist() == [0.5, 0.5]


def test_metric_and_scale_decide_the_cell():
    codewords, maps = [[0.0, 0.75], [0.5, 0.5]], np.zeros((2, 3, 2))
    cell = {
        m: VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, metric=m).cells([0.0, 0.0])
        for m in ("manhattan", "euclidean")
    }
    assert cell == {"manhattan": 0, "euclidean": 1}
    scaled = VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, scale=[1.0, 0.5])  # 1.5 and 1.5, then 1.6 and 1.5
    assert scaled.cells([0.0, 0.0]) == 0 and scaled.cells([0.05, 0.0]) == 1


BAD_OBS = [
    (np.zeros(3), r"shape \(3,\), expected \(2,\) or \(n, 2\) for SimpleGoal-v0"),
    (np.zeros((4, 1)), r"shape \(4, 1\)"),
    (np.zeros((2, 2, 2)), r"shape \(2, 2, 2\)"),
    (0.5, r"shape \(\)"),
    ([0.5, np.nan], r"hold nan at index \(1,\), expected finite"),
    ([[0.5, 1], [np.inf, 0]], r"hold inf at index \(1, 0\)"),
    (["0.5", "0.5"], "type <U3, expected numbers"),
    ([None, 0.5], "type object, expected numbers"),
    ([0.5 + 1j, 0], "type complex128, expected numbers"),
    ([True, False], "type bool, expected numbers"),
]


@pytest.mark.parametrize(("obs", "message"), BAD_OBS)
@pytest.mark.parametrize("method", ["predict", "cells", "linear", "explain"])
def test_a_bad_observation_is_one_clear_error(method, obs, message):
    with pytest.raises(ValueError, match=f"observations have {message}|observations {message}"):
        getattr(TWO, method)(obs)


def test_explain_takes_one_state():
    with pytest.raises(ValueError, match=r"\(3, 2\), expected \(2,\)"):
        TWO.explain(np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"codewords": [[0.1, 0.2, 0.3]] * 2}, r"codewords have shape \(2, 3\), expected \(n, 2\)"),
        ({"codewords": np.zeros((0, 2)), "coefficients": np.zeros((0, 3, 2))}, "at least one codeword"),
        ({"codewords": [[0.5, 0.5], [0.5, 0.5]]}, r"all different, got \[\[0.5, 0.5\], \[0.5, 0.5\]\]"),
        ({"codewords": [[0.5, np.nan], [0, 0]]}, r"codewords hold nan at index \(0, 1\)"),
        ({"codewords": [["a", "b"], ["c", "d"]]}, "codewords have type <U1"),
        ({"coefficients": np.zeros((3, 3, 2))}, r"coefficients have shape \(3, 3, 2\), expected \(2, 3, 2\)"),
        ({"coefficients": np.zeros((2, 2, 2))}, r"expected \(2, 3, 2\)"),
        ({"coefficients": np.full((2, 3, 2), np.inf)}, "coefficients hold inf"),
        ({"coefficients": np.zeros((2, 3, 2), complex)}, "coefficients have type complex128"),
        ({"coefficients": np.full((2, 3, 2), None)}, "coefficients have type object"),
        ({"metric": "cosine"}, "metric is 'cosine', expected one of .*manhattan"),
        ({"scale": [1.0, 0.0]}, r"scale is \[1.0, 0.0\], expected positive"),
        ({"scale": [1.0]}, r"scale have shape|scale has shape"),
        ({"task": "SimpelGoal"}, "did you mean 'SimpleGoal-v0'"),
        ({"task": MOUNTAINCAR}, r"coefficients have shape \(2, 3, 2\), expected \(2, 3, 1\)"),
    ],
)
def test_a_policy_that_cannot_be_is_one_clear_error(change, message):
    good = {"codewords": TWO.codewords, "coefficients": TWO.coefficients, "task": SIMPLEGOAL}
    with pytest.raises(ValueError, match=message):
        VoronoiPolicy(**good | change)


# explain


def test_explain_by_hand():
    told = TWO.explain([0.75, 0.25])
    assert (told.cell, told.next_cell, told.margin) == (1, 0, 0.5)  # 0.5 to the right codeword, 1.0 to the left
    assert told.codeword.tolist() == [1, 0.5] and told.raw.tolist() == [3, -0.5] and told.action.tolist() == [1, -0.5]
    assert told.contributions.to_numpy().tolist() == [[0, 0, 3], [0, 0, -0.5]]
    left = TWO.explain([0.25, 0.25])
    assert left.contributions.to_numpy().tolist() == [[0.25, 0, 0.25], [0, 0.5, -0.5]]
    assert left.contributions.columns.tolist() == ["x", "y", "bias"] and len(left.contributions) == 2
    assert left.equations[0].endswith("= 1.000 x + 0.000 y + 0.250")
    assert left.equations[1].endswith("= 0.000 x + 2.000 y - 0.500")


@given(st.integers(1, 9), st.integers(0, 99), st.sampled_from([SIMPLEGOAL, MOUNTAINCAR]), st.booleans())
def test_an_explanation_is_the_prediction_taken_apart(k, seed, task, scaled):
    task = get_task(task)
    policy = random_policy(k, seed=seed, task=task, scale=task.high - task.low if scaled else None)
    state = np.random.default_rng(seed + 1).uniform(task.low, task.high)
    told = policy.explain(state)
    assert np.allclose(told.contributions.sum(axis=1), told.raw, atol=1e-12)
    assert np.array_equal(told.raw, policy.linear(state)) and np.array_equal(told.action, policy.predict(state)[0])
    assert told.cell == policy.cells(state) and np.array_equal(told.codeword, policy.codewords[told.cell])
    gaps = sorted(distances(state[None] / policy.scale, policy.codewords / policy.scale)[0])
    assert told.margin == pytest.approx(gaps[1] - gaps[0]) if k > 1 else told.margin == np.inf
    assert (told.next_cell is None) == (k == 1) and told.next_cell != told.cell


def test_an_explanation_does_not_let_the_policy_be_changed():
    policy = random_policy()
    told = policy.explain([0.5, 0.5])
    before = policy.predict([0.5, 0.5])[0].copy(), policy.codewords.copy()
    told.contributions.iloc[:] = 7.0
    assert np.array_equal(policy.predict([0.5, 0.5])[0], before[0])


@pytest.mark.parametrize(
    ("coefficients", "text"),
    [
        ([0.5, -1.25, 2], "0.50 x - 1.25 y + 2.00"),
        ([-0.5, 0, -0.004], "-0.50 x + 0.00 y - 0.00"),
        ([0, 0, 0], "0.00 x + 0.00 y + 0.00"),
    ],
)
def test_expression(coefficients, text):
    assert expression(np.array(coefficients), ("x", "y"), 2) == text


@pytest.mark.parametrize(
    ("coefficients", "text"),
    [
        ([0.5, -1.25, 2], "0.5 x - 1.25 y + 2"),
        ([0, -0.00014, 0], "-0.00014 y"),
        ([0, 0, -12000.0], "-12000"),
        ([0, 0, 0], "0"),
    ],
)
def test_an_exact_expression_has_no_zeros_and_loses_no_digit(coefficients, text):
    assert expression(np.array(coefficients), ("x", "y"), None) == text


# frame, files


def test_to_frame_has_a_row_per_cell_and_every_number():
    policy = random_policy()
    frame = policy.to_frame()
    assert frame.shape == (6, 2 + 3 * 2) and frame.index.name == "cell"
    assert np.array_equal(frame.iloc[:, :2], policy.codewords)
    assert np.array_equal(frame.iloc[:, 2:5], policy.coefficients[:, :, 0])
    assert np.array_equal(frame.iloc[:, 5:], policy.coefficients[:, :, 1])
    assert isinstance(frame, pd.DataFrame) and len(set(frame.columns)) == 8


@pytest.mark.parametrize("options", [{}, {"metric": "euclidean"}, {"scale": [0.3, 7.0]}])
def test_save_and_load_are_exact(tmp_path, options):
    policy = random_policy(9, **options)
    policy.save(tmp_path / "p.voronoi")
    back = VoronoiPolicy.load(tmp_path / "p.voronoi")
    assert same_arrays(*((getattr(policy, a), getattr(back, a)) for a in ("codewords", "coefficients", "scale")))
    assert back.metric == policy.metric and back.task is policy.task
    obs = np.random.default_rng(0).random((100, 2))
    assert np.array_equal(policy.predict(obs)[0], back.predict(obs)[0])
    policy.save(tmp_path / "q.voronoi")
    assert (tmp_path / "p.voronoi").read_bytes() == (tmp_path / "q.voronoi").read_bytes()


def test_a_damaged_policy_file_is_refused(tmp_path):
    path = tmp_path / "p.voronoi"
    random_policy().save(path)
    content = path.read_bytes()
    for position in [*range(0, len(content), 7), len(content) - 1]:
        damaged = bytearray(content)
        damaged[position] ^= 1 << position % 8
        path.write_bytes(damaged)
        with pytest.raises(DamagedFile):
            VoronoiPolicy.load(path)
    for n in (0, 10, 65, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:n])
        with pytest.raises(DamagedFile):
            VoronoiPolicy.load(path)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        VoronoiPolicy.load(path)


def test_the_caller_cannot_change_a_policy_through_its_arrays():
    codewords, coefficients = np.array([[0.0, 0.5], [1.0, 0.5]]), np.zeros((2, 3, 2))
    policy = VoronoiPolicy(codewords, coefficients, task=SIMPLEGOAL)
    codewords[:], coefficients[:] = 0.7, 5.0
    assert policy.codewords.tolist() == [[0, 0.5], [1, 0.5]] and not policy.predict([0.1, 0.1])[0].any()


def test_a_policy_of_any_task_object():
    task = dataclasses.replace(
        get_task(SIMPLEGOAL), action_low=np.array([-0.5, -2.0]), action_high=np.array([0.5, 2.0])
    )
    policy = VoronoiPolicy([[0, 0]], [[[0, 0], [0, 0], [3, 1.5]]], task=task)
    assert policy.predict([0.5, 0.5])[0].tolist() == [0.5, 1.5]


# How far the borders are


def test_borders_by_hand():
    """Codewords at x = 0.2 and x = 0.8 (y alike), and far above; in Manhattan distance the border is at x = 0.5."""
    policy = VoronoiPolicy(np.array([[0.2, 0.2], [0.8, 0.2], [0.2, 0.9]]), np.zeros((3, 3, 2)), task=SIMPLEGOAL)
    told = policy.explain(np.array([0.3, 0.1])).borders
    assert told.index.tolist() == ["x", "y"] and told["cell"].tolist() == [1, 2]
    assert told["change"].tolist() == pytest.approx([0.2, 0.45], abs=1e-9)
    back = policy.explain(np.array([0.9, 0.2])).borders
    assert back.at["x", "change"] == pytest.approx(-0.4, abs=1e-9) and back.at["x", "cell"] == 0


def test_without_another_cell_there_is_no_border():
    alone = VoronoiPolicy(np.array([[0.2, 0.2]]), np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    told = alone.explain(np.array([0.3, 0.1])).borders
    assert told["change"].isna().all() and (told["cell"] == -1).all()


@pytest.mark.parametrize("metric", ["manhattan", "euclidean", "chebyshev"])
def test_a_step_beyond_the_border_is_in_the_other_cell(metric):
    rng = np.random.default_rng(0)
    policy = VoronoiPolicy(rng.random((6, 2)), np.zeros((6, 3, 2)), task=SIMPLEGOAL, metric=metric, scale=[1.0, 0.5])
    found = 0
    for state in rng.random((50, 2)):
        told = policy.explain(state)
        for axis, (change, cell) in enumerate(told.borders.itertuples(index=False)):
            way = np.eye(2)[axis]
            if cell < 0:
                line = np.where(way, np.linspace(0, 1, 101)[:, None], state)
                assert (policy.cells(line) == told.cell).all()
                continue
            found += 1
            assert policy.cells(state + change * way) == cell != told.cell
            assert policy.cells(state + (change - np.sign(change) * 1e-8) * way) == told.cell
    assert found > 60


# Other classes of sub-policy

FORMS = ("constant", "linear", "quadratic", "pid", "network")


def policy_of(form, task=PENDULUM, k=6, seed=0):
    rng, task = np.random.default_rng(seed), get_task(task)
    units, codewords = form_of(form, task).units, rng.uniform(task.low, task.high, size=(k, len(task.low)))
    coefficients = rng.normal(size=(k, len(units), len(task.action_low))) / units
    return VoronoiPolicy(codewords, coefficients, task=task, sub_policy=form)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("task", [MOUNTAINCAR, PENDULUM])
def test_every_class_acts_and_explains_itself(form, task):
    policy = policy_of(form, task)
    obs = np.random.default_rng(1).uniform(policy.task.low, policy.task.high, size=(40, len(policy.task.low)))
    actions, _ = policy.predict(obs)
    assert np.allclose(actions, [policy.predict(one)[0] for one in obs], atol=1e-12) and len(np.unique(actions)) > 3
    for one in obs[:10]:
        told = policy.explain(one)
        assert np.allclose(told.contributions.sum(axis=1), told.raw, atol=1e-9)
        assert told.contributions.index.tolist() == list(policy.task.outputs)
        assert told.equations == policy.equations(told.cell) and len(told.equations) == len(policy.task.outputs)


def test_a_pid_controller_by_hand():
    policy = VoronoiPolicy([[-0.5, 0.0]], [[[0.5], [-20.0], [0.1]]], task=MOUNTAINCAR, sub_policy="pid")
    told = policy.explain([-0.55, 0.03])  # a whole unit to go, getting nearer by 0.03 a step
    assert told.contributions.loc["F"].to_dict() == pytest.approx({"e": 0.5, "ė": 0.6, "bias": 0.1})
    assert told.action == pytest.approx([1.0]) and told.raw == pytest.approx([1.2])
    assert told.equations == ("F = 0.500 e - 20.000 ė + 0.100",)
    assert policy.to_frame().columns.tolist() == ["codeword_x", "codeword_v", "F_e", "F_ė", "F_bias"]


@pytest.mark.parametrize("form", FORMS)
def test_save_and_load_keep_the_class(form, tmp_path):
    policy = policy_of(form)
    policy.save(tmp_path / "p.vsp")
    back = VoronoiPolicy.load(tmp_path / "p.vsp")
    assert back.form.name == form and np.array_equal(back.coefficients, policy.coefficients)
    assert policy.to_frame().shape == (6, 3 + len(policy.form.rows))


def test_a_file_that_names_no_class_holds_linear_policies(tmp_path):
    policy = random_policy()
    arrays = {"codewords": policy.codewords, "coefficients": policy.coefficients, "scale": policy.scale}
    store.save(tmp_path / "p.vsp", arrays, {"kind": "VoronoiPolicy", "task": SIMPLEGOAL, "metric": "manhattan"})
    back = VoronoiPolicy.load(tmp_path / "p.vsp")
    assert back.form.name == "linear" and np.array_equal(back.coefficients, policy.coefficients)


def test_coefficients_of_another_class_are_refused():
    with pytest.raises(ValueError, match=r"coefficients have shape \(6, 4, 1\), expected \(6, 10, 1\)"):
        VoronoiPolicy(policy_of("linear").codewords, np.zeros((6, 4, 1)), task=PENDULUM, sub_policy="quadratic")
    with pytest.raises(ValueError, match="sub_policy is 'spline', expected one of"):
        VoronoiPolicy([[0, 0]], np.zeros((1, 3, 2)), task=SIMPLEGOAL, sub_policy="spline")


@pytest.mark.parametrize(
    "use",
    [
        lambda policy: refine(None, MOUNTAINCAR, Refinement(n_cells=6), seed=0, start=policy),
        lambda policy: Crowd([policy]),
        lambda policy: prune(policy, lambda one: True),
        lambda policy: cost(policy),
        lambda policy: refit(policy, np.zeros((3, 2)), np.zeros((3, 1))),
    ],
    ids=["refine", "Crowd", "prune", "cost", "refit"],
)
def test_what_knows_linear_policies_alone_refuses_others(use):
    """The PID class of MountainCar has as many parameters as the linear one: nothing else would notice."""
    with pytest.raises(ValueError, match="the policy has sub_policy 'pid', expected 'linear'"):
        use(policy_of("pid", MOUNTAINCAR))


def test_rounding_keeps_the_class():
    short = rounded(policy_of("quadratic"), 2)
    assert short.form.name == "quadratic" and np.allclose(
        short.coefficients, policy_of("quadratic").coefficients, rtol=0.06
    )
