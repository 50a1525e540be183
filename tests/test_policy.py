import dataclasses

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, same_arrays

import vsp
from studies.comparison.measure import parameters_of
from vsp.geometry import distances
from vsp.paper.baselines import refit
from vsp.policy import VoronoiPolicy
from vsp.run import sealed
from vsp.run.atomic import DamagedFile
from vsp.subpolicies.base import expression
from vsp.subpolicies.registry import policy_class
from vsp.tasks.registry import get_task
from vsp_beyond.explain.lime import compare_maps
from vsp_beyond.explain.rules import RulePolicy
from vsp_beyond.few_cells.config import Tuned
from vsp_beyond.few_cells.population import PolicyBatch
from vsp_beyond.few_cells.simplification import prune, rounded
from vsp_beyond.few_cells.tuned import distill_tuned


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


def test_an_empty_batch_and_a_list():
    assert TWO.predict(np.zeros((0, 2)))[0].shape == (0, 2)
    assert TWO.predict([0.25, 0.5])[0].tolist() == [0.5, 0.5]


def test_what_the_look_up_uses_cannot_be_edited_behind_its_back():
    codewords, scale = np.array([[0.2, 0.5], [0.8, 0.5]]), np.ones(2)
    policy = VoronoiPolicy(codewords, np.zeros((2, 3, 2)), task=SIMPLEGOAL, scale=scale)
    codewords[0], scale[0] = 9.0, 9.0  # copies of the caller's
    assert policy.cells([[0.3, 0.5], [0.7, 0.5]]).tolist() == [0, 1]
    for array in (policy.codewords, policy.scale):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


def test_metric_and_scale_decide_the_cell():
    codewords, maps = [[0.0, 0.75], [0.5, 0.5]], np.zeros((2, 3, 2))
    for metric, cell in (("manhattan", 0), ("euclidean", 1)):
        assert VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, metric=metric).cells([0.0, 0.0]) == cell
    scaled = VoronoiPolicy(codewords, maps, task=SIMPLEGOAL, scale=[1.0, 0.5])  # 1.5 and 1.5, then 1.6 and 1.5
    assert scaled.cells([0.0, 0.0]) == 0 and scaled.cells([0.05, 0.0]) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": [5e-324, 1.0]}, r"scale is \[5e-324, 1.0\], expected positive numbers of at least 1e-50"),
        ({"scale": [1e300, 1.0]}, r"scale hold 1e\+300, expected numbers of at most 1e\+50 in absolute value"),
        ({"codewords": [[0, 1], [1e300, 0]]}, r"codewords hold 1e\+300, expected .*1e\+50 in absolute value"),
        ({"coefficients": np.full((2, 3, 2), -1e300)}, r"coefficients hold 1e\+300, expected numbers of at most"),
        ({"task": MOUNTAINCAR}, r"coefficients have shape \(2, 3, 2\), expected \(2, 3, 1\)"),
    ],
)
def test_a_policy_of_numbers_beyond_all_bounds_is_one_clear_error(change, message):
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
    assert repr(TWO) == "<VoronoiPolicy of SimpleGoal-v0: 2 cells, 2 inputs, 2 actions; to_text() shows it>"
    first, *_, action, other = str(left).splitlines()
    assert first == "cell 0" and action == "action within the limits: Δx = 0.5, Δy = 0"
    assert other == "another cell, by changing one input: x +0.25 (cell 1)"


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
    before = policy.predict([0.5, 0.5])[0].copy()
    told.contributions.iloc[:] = 7.0
    assert np.array_equal(policy.predict([0.5, 0.5])[0], before)


@pytest.mark.parametrize(
    ("coefficients", "two_digits", "exact"),
    [
        ([0.5, -1.25, 2], "0.50 x - 1.25 y + 2.00", "0.5 x - 1.25 y + 2"),
        ([-0.5, 0, -0.004], "-0.50 x + 0.00 y - 0.00", "-0.5 x - 0.004"),
        ([0, -0.00014, 0], "0.00 x - 0.00 y + 0.00", "-0.00014 y"),
        ([0, 0, -12000.0], "0.00 x + 0.00 y - 12000.00", "-12000"),
        ([0, 0, 0], "0.00 x + 0.00 y + 0.00", "0"),
    ],
)
def test_expressions_lose_zeros_but_no_digit_where_they_are_exact(coefficients, two_digits, exact):
    for digits, text in ((2, two_digits), (None, exact)):
        assert expression(np.array(coefficients), ("x", "y"), digits) == text


# frame, files


def test_to_frame_has_a_row_per_cell_and_every_number():
    policy = random_policy()
    frame = policy.to_frame()
    assert frame.shape == (6, 2 + 3 * 2) and frame.index.name == "cell"
    assert np.array_equal(frame.iloc[:, :2], policy.codewords)
    assert np.array_equal(frame.iloc[:, 2:5], policy.coefficients[:, :, 0])
    assert np.array_equal(frame.iloc[:, 5:], policy.coefficients[:, :, 1])
    assert isinstance(frame, pd.DataFrame) and len(set(frame.columns)) == 8


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


def test_the_caller_cannot_change_a_policy_through_its_arrays():
    codewords, coefficients = np.array([[0.0, 0.5], [1.0, 0.5]]), np.zeros((2, 3, 2))
    policy = VoronoiPolicy(codewords, coefficients, task=SIMPLEGOAL)
    codewords[:], coefficients[:] = 0.7, 5.0
    assert policy.codewords.tolist() == [[0, 0.5], [1, 0.5]] and not policy.predict([0.1, 0.1])[0].any()


def test_a_policy_of_any_task_object():
    high = np.array([0.5, 2.0])
    task = dataclasses.replace(get_task(SIMPLEGOAL), action_low=-high, action_high=high)
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

CLASSES = ("constant", "linear", "quadratic", "pid", "network")


def policy_of(form, task=PENDULUM, k=6, seed=0):
    rng, task = np.random.default_rng(seed), get_task(task)
    units, codewords = policy_class(form, task).units, rng.uniform(task.low, task.high, size=(k, len(task.low)))
    coefficients = rng.normal(size=(k, len(units), len(task.action_low))) / units
    return VoronoiPolicy(codewords, coefficients, task=task, sub_policy=form)


@pytest.mark.parametrize("form", CLASSES)
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


@pytest.mark.parametrize(
    "policy",
    [random_policy(9, metric="euclidean"), random_policy(9, scale=[0.3, 7.0]), *map(policy_of, CLASSES)],
)
def test_save_and_load_are_exact(policy, tmp_path):
    policy.save(tmp_path / "p.voronoi")
    back = VoronoiPolicy.load(tmp_path / "p.voronoi")
    assert same_arrays(*((getattr(policy, a), getattr(back, a)) for a in ("codewords", "coefficients", "scale")))
    assert (back.metric, back.policy_class.name, back.task) == (policy.metric, policy.policy_class.name, policy.task)
    policy.save(tmp_path / "q.voronoi")
    assert (tmp_path / "p.voronoi").read_bytes() == (tmp_path / "q.voronoi").read_bytes()


def test_a_policy_of_a_task_that_is_not_registered_acts_with_its_names(tmp_path):
    names = {"name": "Nowhere-v0", "inputs": ("east", "north"), "outputs": ("push", "pull")}
    policy = random_policy(task=dataclasses.replace(get_task(SIMPLEGOAL), **names))
    policy.save(tmp_path / "p.vsp")
    back = VoronoiPolicy.load(tmp_path / "p.vsp")
    states = np.random.default_rng(0).random((9, 2))
    assert np.array_equal(back.predict(states)[0], policy.predict(states)[0])
    assert back.to_text() == policy.to_text() and "east" in back.to_text() and "push" in back.to_c()
    with pytest.raises(ValueError, match="Nowhere-v0 is not registered here, so its policy can act but no episode"):
        vsp.evaluate(back, back.task, seed=0)


def test_the_names_of_a_saved_policy_win(tmp_path):
    policy = random_policy(task=dataclasses.replace(get_task(SIMPLEGOAL), outputs=("push", "pull")))
    policy.save(tmp_path / "p.vsp")
    back = VoronoiPolicy.load(tmp_path / "p.vsp")
    assert back.task.outputs == ("push", "pull") and len(vsp.evaluate(back, back.task, n_episodes=3, seed=0)) == 3


@pytest.mark.parametrize(
    "change",
    [
        {"codewords": np.full((6, 2), 1e300)}, {"coefficients": np.full((6, 3, 2), np.nan)}, {"scale": [5e-324, 1.0]},
        {"codewords": np.zeros((6, 2))}, {"other": np.zeros(1)}, {"sub_policy": "spline"}, {"low": np.zeros(3)},
        {"low": np.full(2, -9.0)}, {"action_high": np.ones((2, 1))}, {"inputs": "x, y"}, {"task": "Pendulum-v1"},
    ],
)  # fmt: skip
def test_a_sealed_file_that_holds_no_policy_is_refused(change, tmp_path):
    policy = random_policy()
    policy.save(tmp_path / "p.vsp")
    arrays, about = sealed.load_arrays(tmp_path / "p.vsp", kind="VoronoiPolicy")
    arrays |= {name: np.asarray(value) for name, value in change.items() if not isinstance(value, str)}
    about |= {name: value for name, value in change.items() if isinstance(value, str)}
    sealed.save_arrays(tmp_path / "p.vsp", arrays, about)
    with pytest.raises(DamagedFile, match="p.vsp: the checksum is right, but the file holds no valid policy"):
        VoronoiPolicy.load(tmp_path / "p.vsp")


@pytest.mark.parametrize(
    "use",
    [
        lambda policy: distill_tuned(None, MOUNTAINCAR, Tuned(n_cells=6), seed=0, start=policy),
        lambda policy: PolicyBatch([policy]),
        lambda policy: prune(policy, lambda one: True),
        lambda policy: parameters_of(policy),
        lambda policy: refit(policy, np.zeros((3, 2)), np.zeros((3, 1))),
        lambda policy: RulePolicy(policy, []),
        lambda policy: compare_maps(policy, policy, np.zeros((1, 2)), scale=np.ones(2), rng=np.random.default_rng(0)),
    ],
    ids=["refine", "PolicyBatch", "prune", "parameters_of", "refit", "RulePolicy", "compare_maps"],
)
def test_what_knows_linear_policies_alone_refuses_others(use):
    """The PID class of MountainCar has as many parameters as the linear one: nothing else would notice."""
    with pytest.raises(ValueError, match="sub_policy 'pid', expected 'linear'"):
        use(policy_of("pid", MOUNTAINCAR))


def test_rounding_keeps_the_class():
    short = rounded(policy_of("quadratic"), 2)
    assert short.policy_class.name == "quadratic"
    assert np.allclose(short.coefficients, policy_of("quadratic").coefficients, rtol=0.06)


def test_borders_where_the_box_has_no_limits():
    policy = VoronoiPolicy(np.eye(2, 17), np.zeros((2, 18, 6)), task=CHEETAH)
    told = policy.explain(0.2 * np.eye(1, 17)[0])  # 0.8 from the first codeword, 1.2 from the other
    assert told.borders["cell"].tolist() == [-1, 1] + [-1] * 15
    assert told.borders["change"].iloc[1] == pytest.approx(0.2, abs=1e-9) and str(told).endswith("θ +0.2 (cell 1)")


def test_an_explanation_in_words_names_cell_0_or_says_that_there_is_no_border():
    two = VoronoiPolicy([[0.25, 0.25], [0.75, 0.25]], np.zeros((2, 3, 2)), task=SIMPLEGOAL)
    assert str(two.explain([0.75, 0.25])).endswith("by changing one input: x -0.25 (cell 0)")
    alone = VoronoiPolicy([[0.5, 0.5]], np.zeros((1, 3, 2)), task=SIMPLEGOAL)
    assert str(alone.explain([0.1, 0.1])).endswith("by changing one input: none in the box")
