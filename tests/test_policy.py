import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import MOUNTAINCAR, PENDULUM, SIMPLEGOAL, random_policy, same_arrays

import vsp
from vsp.checks import check_finite
from vsp.geometry import METRICS, distances
from vsp.paper.baselines import refit
from vsp.run import sealed
from vsp.run.atomic import DamagedFile
from vsp.subpolicies import POLICY_CLASSES, policy_class

TWO = vsp.VoronoiPolicy(  # cells left and right; the right one answers constants, one of them beyond the limits
    [[0.0, 0.5], [1.0, 0.5]], [[[1, 0], [0, 2], [0.25, -0.5]], [[0, 0], [0, 0], [3, -0.5]]], task=SIMPLEGOAL
)


def motionless(codewords, *, task=SIMPLEGOAL, **options):
    """A policy whose actions are zero."""
    task, (k, d) = vsp.get_task(task), np.shape(codewords)
    return vsp.VoronoiPolicy(codewords, np.zeros((k, d + 1, len(task.action_low))), task=task, **options)


# predict


def test_predict_by_hand():
    action, state = TWO.predict(np.array([0.25, 0.5]))
    assert state is None and action.tolist() == [0.5, 0.5]  # x + 0.25, 2 y - 0.5
    assert TWO.predict([0.75, 0.5])[0].tolist() == [1.0, -0.5] and TWO.linear([0.75, 0.5]).tolist() == [3.0, -0.5]
    assert TWO.predict(np.array([[0.5, 0.5]]))[0].tolist() == [[0.75, 0.5]]  # a tie goes to the lower index
    assert TWO.predict(np.zeros((0, 2)))[0].shape == (0, 2)


@pytest.mark.parametrize("task", [SIMPLEGOAL, MOUNTAINCAR, PENDULUM])
def test_a_batch_is_its_rows(task):
    policy, task = random_policy(20, task=task), vsp.get_task(task)
    obs = np.random.default_rng(1).uniform(task.low, task.high, size=(300, len(task.low))).astype(np.float32)
    actions, _ = policy.predict(obs)
    assert actions.shape == (300, len(task.action_low)) and actions.dtype == np.float64
    assert np.array_equal(actions, [policy.predict(row)[0] for row in obs])
    assert (actions == task.action_high).any() and (actions == task.action_low).any()
    assert policy.cells(obs).tolist() == [policy.cells(row) for row in obs]
    assert np.array_equal(actions, np.clip(policy.linear(obs), task.action_low, task.action_high))


@pytest.mark.parametrize("kind", [int, np.uint8, np.float16])
def test_whole_numbers_are_observations_too(kind):
    corners = np.array([[0, 0], [0, 1], [1, 1]])
    for act in (TWO.linear, TWO.cells, lambda obs: TWO.explain(obs[0]).raw):
        assert np.array_equal(act(corners.astype(kind)), act(corners.astype(np.float64)))
    assert check_finite("numbers", corners.astype(kind)).dtype == np.float64


def test_each_action_has_its_own_limits():
    high = np.array([0.5, 2.0])
    task = dataclasses.replace(vsp.get_task(SIMPLEGOAL), action_low=-high, action_high=high)
    policy = vsp.VoronoiPolicy([[0, 0]], [[[0, 0], [0, 0], [3, 1.5]]], task=task)
    assert policy.predict([0.5, 0.5])[0].tolist() == [0.5, 1.5]


def test_the_caller_cannot_change_a_policy_through_its_arrays():
    codewords, coefficients, scale = np.array([[0.2, 0.5], [0.8, 0.5]]), np.zeros((2, 3, 2)), np.ones(2)
    policy = vsp.VoronoiPolicy(codewords, coefficients, task=SIMPLEGOAL, scale=scale)
    codewords[0], coefficients[:], scale[0] = 9.0, 9.0, 9.0
    assert policy.cells([[0.3, 0.5], [0.7, 0.5]]).tolist() == [0, 1] and not policy.predict([0.3, 0.5])[0].any()
    for array in (policy.codewords, policy.scale):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": [5e-324, 1.0]}, r"scale is \[5e-324, 1.0\], expected positive numbers of at least 1e-50"),
        ({"scale": [1e300, 1.0]}, r"scale hold 1e\+300, expected numbers of at most 1e\+50 in absolute value"),
        ({"codewords": [[0, 1], [1e300, 0]]}, r"codewords hold 1e\+300, expected .*1e\+50 in absolute value"),
        ({"coefficients": np.full((2, 3, 2), -1e300)}, r"coefficients hold 1e\+300, expected numbers of at most"),
    ],
)
def test_a_policy_of_numbers_beyond_all_bounds_is_one_clear_error(change, message):
    good = {"codewords": TWO.codewords, "coefficients": TWO.coefficients, "task": SIMPLEGOAL}
    with pytest.raises(ValueError, match=message):
        vsp.VoronoiPolicy(**good | change)


def test_what_knows_linear_policies_alone_refuses_others():
    with pytest.raises(ValueError, match="sub_policy 'constant', expected 'linear'"):
        refit(random_policy(task=MOUNTAINCAR, form="constant"), np.zeros((3, 2)), np.zeros((3, 1)))


# explain


def test_explain_by_hand():
    left = TWO.explain([0.25, 0.25])
    assert left.contributions.to_numpy().tolist() == [[0.25, 0, 0.25], [0, 0.5, -0.5]]
    assert left.contributions.columns.tolist() == ["x", "y", "bias"]
    assert left.equations[0].endswith("= 1.000 x + 0.000 y + 0.250")
    assert left.equations[1].endswith("= 0.000 x + 2.000 y - 0.500")
    assert repr(TWO) == "<VoronoiPolicy of SimpleGoal-v0: 2 cells, 2 inputs, 2 actions; to_text() shows it>"
    first, *_, action, other = str(left).splitlines()
    assert first == "cell 0" and action == "action within the limits: Δx = 0.5, Δy = 0"
    assert other == "another cell, by changing one input: x +0.25 (cell 1)"
    assert str(TWO.explain([0.75, 0.25])).endswith("x -0.25 (cell 0)")


given_a_class = st.sampled_from(list(POLICY_CLASSES))


@given(st.integers(1, 9), st.integers(0, 99), st.sampled_from([SIMPLEGOAL, PENDULUM]), given_a_class, st.booleans())
def test_an_explanation_is_the_prediction_taken_apart(k, seed, task, form, scaled):
    task = vsp.get_task(task)
    policy = random_policy(k, seed=seed, task=task, form=form, scaled=scaled)
    state = np.random.default_rng(seed + 1).uniform(task.low, task.high)
    told = policy.explain(state)
    assert np.array_equal(told.raw, policy.linear(state)) and np.array_equal(told.action, policy.predict(state)[0])
    assert told.cell == policy.cells(state) and np.array_equal(told.codeword, policy.codewords[told.cell])
    assert np.allclose(told.contributions.sum(axis=1), told.raw, atol=1e-9)
    assert told.contributions.index.tolist() == list(task.outputs) and told.equations == policy.equations(told.cell)
    gaps = sorted(distances(state[None] / policy.scale, policy.codewords / policy.scale)[0])
    assert told.margin == pytest.approx(gaps[1] - gaps[0]) if k > 1 else told.margin == np.inf
    assert (told.next_cell is None) == (k == 1) and told.next_cell != told.cell
    told.contributions.iloc[:] = 7.0
    assert np.array_equal(policy.predict(state)[0], told.action), "editing an explanation changes the policy"


@pytest.mark.parametrize(
    ("coefficients", "two_digits", "exact"),
    [
        ([0.5, -1.25, 2], "0.50 x - 1.25 y + 2.00", "0.5 x - 1.25 y + 2"),
        ([-0.5, 0, -0.004], "-0.50 x + 0.00 y - 0.00", "-0.5 x - 0.004"),
        ([0, -0.00014, -12000.0], "0.00 x - 0.00 y - 12000.00", "-0.00014 y - 12000"),
        ([0, 0, 0], "0.00 x + 0.00 y + 0.00", "0"),
    ],
)
def test_expressions_lose_zeros_but_no_digit_where_they_are_exact(coefficients, two_digits, exact):
    for digits, text in ((2, two_digits), (None, exact)):
        assert policy_class("linear", vsp.get_task(SIMPLEGOAL)).expression(np.array(coefficients), digits) == text


# How far the borders are


def test_borders_by_hand():
    """Codewords at x = 0.2 and x = 0.8 (y alike), and far above; in Manhattan distance the border is at x = 0.5."""
    policy = motionless([[0.2, 0.2], [0.8, 0.2], [0.2, 0.9]])
    told = policy.explain(np.array([0.3, 0.1])).borders
    assert told.index.tolist() == ["x", "y"] and told["cell"].tolist() == [1, 2]
    assert told["change"].tolist() == pytest.approx([0.2, 0.45], abs=1e-9)
    back = policy.explain(np.array([0.9, 0.2])).borders
    assert back.at["x", "change"] == pytest.approx(-0.4, abs=1e-9) and back.at["x", "cell"] == 0


def test_without_another_cell_there_is_no_border():
    told = motionless([[0.2, 0.2]]).explain(np.array([0.3, 0.1]))
    assert told.borders["change"].isna().all() and (told.borders["cell"] == -1).all()
    assert str(told).endswith("by changing one input: none in the box")


def test_borders_where_the_box_has_no_limits():
    task = dataclasses.replace(vsp.get_task(SIMPLEGOAL), low=np.full(2, -np.inf), high=np.full(2, np.inf))
    told = motionless([[0.0, 0.0], [4.0, 0.0]], task=task).explain([1.5, 0.0])
    assert told.borders["cell"].tolist() == [1, -1]
    assert told.borders.at["x", "change"] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("metric", METRICS)
def test_a_step_beyond_the_border_is_in_the_other_cell(metric):
    rng, n_borders = np.random.default_rng(0), 0
    policy = motionless(rng.random((6, 2)), metric=metric, scale=[1.0, 0.5])
    for state in rng.random((50, 2)):
        told = policy.explain(state)
        for axis, (change, cell) in zip(np.eye(2), told.borders.itertuples(index=False)):
            if cell < 0:
                line = np.where(axis, np.linspace(0, 1, 101)[:, None], state)
                assert (policy.cells(line) == told.cell).all()
                continue
            n_borders += 1
            assert policy.cells(state + change * axis) == cell != told.cell
            assert policy.cells(state + (change - np.sign(change) * 1e-8) * axis) == told.cell
    assert n_borders > 60


def test_to_frame_has_a_row_per_cell_and_every_number():
    policy = random_policy()
    frame = policy.to_frame()
    numbers = [policy.codewords, policy.coefficients[:, :, 0], policy.coefficients[:, :, 1]]
    assert np.array_equal(frame, np.concatenate(numbers, axis=1)) and frame.index.name == "cell"


# Files


@pytest.mark.parametrize(
    "policy",
    [
        random_policy(9, metric="euclidean", scale=[0.3, 7.0]),
        *(random_policy(task=PENDULUM, form=f) for f in POLICY_CLASSES),
    ],
)
def test_save_and_load_are_exact(policy, tmp_path):
    policy.save(tmp_path / "p.voronoi")
    back = vsp.VoronoiPolicy.load(tmp_path / "p.voronoi")
    assert same_arrays(*((getattr(policy, a), getattr(back, a)) for a in ("codewords", "coefficients", "scale")))
    assert (back.metric, back.policy_class.name, back.task) == (policy.metric, policy.policy_class.name, policy.task)


def test_the_names_of_a_saved_policy_win_and_it_acts_even_if_its_task_is_not_registered(tmp_path):
    states, names = np.random.default_rng(0).random((9, 2)), {"inputs": ("east", "north"), "outputs": ("push", "pull")}
    for name in (SIMPLEGOAL, "Nowhere-v0"):
        policy = random_policy(task=dataclasses.replace(vsp.get_task(SIMPLEGOAL), name=name, **names))
        policy.save(tmp_path / name)
        back = vsp.VoronoiPolicy.load(tmp_path / name)
        assert np.array_equal(back.predict(states)[0], policy.predict(states)[0])
        assert back.to_text() == policy.to_text() and "east" in back.to_text() and "push" in back.to_c()
        if name == SIMPLEGOAL:
            assert len(vsp.evaluate(back, back.task, n_episodes=3, seed=0)) == 3
    with pytest.raises(ValueError, match="Nowhere-v0 is not registered here, so its policy can act but no episode"):
        vsp.evaluate(back, back.task, seed=0)


@pytest.mark.parametrize(
    "change",
    [
        {"codewords": np.zeros((6, 2))}, {"other": np.zeros(1)}, {"sub_policy": "spline"}, {"low": np.zeros(3)},
        {"low": np.full(2, -9.0)}, {"inputs": "x, y"}, {"task": None}, {"sub_policy": []}, {"metric": {}},
    ],
)  # fmt: skip
def test_a_sealed_file_that_holds_no_policy_is_refused(change, tmp_path):
    random_policy().save(tmp_path / "p.vsp")
    arrays, about = sealed.load_arrays(tmp_path / "p.vsp", kind="VoronoiPolicy")
    for name, value in change.items():
        (arrays if isinstance(value, np.ndarray) else about)[name] = value
    sealed.save_arrays(tmp_path / "p.vsp", arrays, about)
    with pytest.raises(DamagedFile, match="p.vsp: the checksum is right, but the file (holds no|lacks or names)"):
        vsp.VoronoiPolicy.load(tmp_path / "p.vsp")
