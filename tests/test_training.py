import dataclasses

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS

import vsp
from vsp import store, training
from vsp.envs import GOAL, PIT, get_task
from vsp.evaluate import outcomes
from vsp.teachers import SHIPPED, load_teacher
from vsp.training import BARS, RECIPES, Recipe

# Shipped


@pytest.mark.parametrize("task", TASKS)
def test_the_shipped_teacher_reaches_its_bar(task):
    teacher = load_teacher(task)
    mean, failures = BARS[task]
    card = teacher.card["score"]
    result = outcomes(teacher, task, 4000, seed=20_240)  # starts that no one chose a seed on
    assert card["episodes"] == 10_000 and card["mean"] >= mean and 1 - card["goal"] <= failures
    assert result.returns.mean() >= mean and np.mean(result.codes != GOAL) <= failures
    assert np.mean(result.codes == PIT) < 0.01


@pytest.mark.parametrize("task", TASKS)
def test_the_card_tells_what_was_done(task):
    card = load_teacher(task).card
    recipe = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in dataclasses.asdict(RECIPES[task]).items()
    }
    assert card["task"] == task and card["recipe"] == recipe
    assert card["seed"] in [tried["seed"] for tried in card["seeds_tried"]]
    assert {"torch", "stable-baselines3", "gymnasium", "numpy"} <= set(card["versions"])
    assert card["learning_curve"][-1]["steps"] >= recipe["steps"]
    assert card["sha256"] == store.sha256(SHIPPED / f"{task}.safetensors")


@pytest.mark.parametrize("task", TASKS)
def test_the_score_on_the_card_is_found_again(task):
    teacher = load_teacher(task)
    found = training.score(teacher, task)
    written = teacher.card["score"]
    assert found["mean"] == pytest.approx(written["mean"], abs=0.01) and found["std"] == pytest.approx(
        written["std"], abs=0.01
    )
    assert found["goal"] == pytest.approx(written["goal"], abs=2e-4)


@pytest.mark.parametrize("task", TASKS)
def test_the_critics_are_shipped_too(task):
    from safetensors.numpy import load_file

    tensors = load_file(SHIPPED / f"{task}.safetensors")
    d, m = len(get_task(task).low), len(get_task(task).action_low)
    assert [tensors[f"critic.qf{i}.0.weight"].shape for i in (0, 1)] == [(400, d + m)] * 2
    assert tensors["actor.mu.0.weight"].shape == (400, d) and all(np.isfinite(t).all() for t in tensors.values())


SHORT = Recipe(steps=90, batch_size=8, learning_starts=20, buffer_size=200)
EPISODIC = Recipe(
    steps=60, batch_size=8, train_freq=(1, "episode"), gradient_steps=-1, learning_starts=10, buffer_size=70,
    noise="ornstein-uhlenbeck", noise_std=0.5,
)  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(training, "CHUNK", 31)  # an odd number of updates, so that the delay of the policy matters
    monkeypatch.setattr(training, "RECIPES", {SIMPLEGOAL: SHORT, MOUNTAINCAR: SHORT})


def weights(path):
    import torch

    return {name: t.numpy() for name, t in torch.load(path, weights_only=True)["policy"].items()}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


WANDERING = dataclasses.replace(SHORT, noise="ornstein-uhlenbeck", noise_std=0.5)  # noise with a memory


@pytest.mark.parametrize("recipe", [SHORT, EPISODIC, WANDERING])
@pytest.mark.parametrize("stop_after", [2])
def test_a_resumed_training_ends_with_the_same_weights(short, tmp_path, monkeypatch, recipe, stop_after):
    monkeypatch.setattr(training, "RECIPES", {SIMPLEGOAL: recipe})
    whole = training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "whole", report=lambda line: None)
    lines = []

    def interrupt(line):
        lines.append(line)
        if len(lines) == stop_after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=interrupt)
    cut = training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=lines.append)
    assert same(weights(whole), weights(cut)) and len(lines) > stop_after
    other = training.train(SIMPLEGOAL, seed=4, cache=tmp_path / "whole", report=lambda line: None)
    assert not same(weights(whole), weights(other))


def test_a_finished_training_is_not_done_again(short, tmp_path):
    first, lines = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None), []
    before = first.read_bytes()
    again = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert again == first and not lines and again.read_bytes() == before


def test_a_changed_recipe_or_seed_does_not_resume(short, tmp_path, monkeypatch):
    path = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    lines, changed = [], dataclasses.replace(SHORT, noise_std=0.2)
    monkeypatch.setattr(training, "RECIPES", {SIMPLEGOAL: changed})
    other = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert other != path and len(lines) == 3 and path.exists()
    for field in dataclasses.fields(Recipe):
        value = getattr(SHORT, field.name)
        altered = (2, "step") if isinstance(value, tuple) else "x" if isinstance(value, str) else value + 1
        assert dataclasses.replace(SHORT, **{field.name: altered}).id != SHORT.id


def test_export_writes_what_load_teacher_reads(short, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "BARS", {SIMPLEGOAL: (-100.0, 1.0)})
    paths = {seed: training.train(SIMPLEGOAL, seed=seed, cache=tmp_path, report=lambda line: None) for seed in (0, 1)}
    reached = training.export(SIMPLEGOAL, paths, tmp_path / "out")
    teacher = load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors")
    assert reached and teacher.card["seed"] == 1 and [t["seed"] for t in teacher.card["seeds_tried"]] == [0, 1]
    assert np.array_equal(teacher.layers[0][0].T, weights(paths[1])["actor.mu.0.weight"])
    assert [point["steps"] for point in teacher.card["learning_curve"]] == [31, 62, 90]
    found = training.score(teacher, SIMPLEGOAL)
    assert {name: teacher.card["score"][name] for name in found} == found


def test_a_teacher_below_the_bar_takes_nobodys_place(short, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "BARS", {SIMPLEGOAL: (1000.0, 0.0)})
    monkeypatch.setattr(training, "MOST_SEEDS", 2)
    out = tmp_path / "out"
    monkeypatch.setattr("sys.argv", ["x", "--cache", str(tmp_path / "cache"), "--out", str(out), "--task", SIMPLEGOAL])
    with pytest.raises(SystemExit, match="none of the seeds 0 to 1 reached the bar"):
        training.main()
    assert not out.exists() and len(list((tmp_path / "cache").iterdir())) == 2


@pytest.mark.parametrize(
    ("task", "mean", "goal", "reached"),
    [
        (SIMPLEGOAL, 16.3, 0.991, True), (SIMPLEGOAL, 16.29, 1.0, False), (SIMPLEGOAL, 17.0, 0.98, False),
        (MOUNTAINCAR, 93.3, 1.0, True), (MOUNTAINCAR, 95.0, 0.9999, False), (MOUNTAINCAR, 93.29, 1.0, False),
    ],
)  # fmt: skip
def test_reaches_bar(task, mean, goal, reached):
    assert training.reaches_bar({"mean": mean, "goal": goal, "pit": 1 - goal}, task) == reached


def test_the_recipes_are_those_of_the_paper():
    goal, car = RECIPES[SIMPLEGOAL], RECIPES[MOUNTAINCAR]
    assert (goal.steps, goal.batch_size, goal.train_freq) == (500_000, 256, (1, "step"))
    assert (car.steps, car.noise, car.noise_std, car.batch_size) == (300_000, "ornstein-uhlenbeck", 0.5, 100)
    assert (car.train_freq, car.gradient_steps, car.learning_rate) == ((1, "episode"), -1, 1e-3)
    assert vsp.load_teacher is load_teacher
