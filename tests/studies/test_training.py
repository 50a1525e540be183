import dataclasses
from importlib.util import find_spec

import numpy as np
import pytest
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, WALKER, called

from studies import make_teachers, training
from studies.make_teachers import BARS, export, main, short_recipe
from studies.training import BEST_OF_CURVE, RECIPES, Recipe, read_checkpoint
from vsp.evaluation import rollout_from_seed
from vsp.run import atomic, command, listed
from vsp.tasks.base import GOAL
from vsp.teachers.teacher import SHIPPED, load_teacher
from vsp_beyond.few_cells.criticality import Critics


@pytest.fixture(autouse=True)
def denormal_numbers():
    """Training flushes them to zero, in the whole process; the tests that come next may need them."""
    yield
    import torch

    torch.set_flush_denormal(False)


# Shipped


def in_json(recipe):
    return {key: list(v) if isinstance(v, tuple) else v for key, v in dataclasses.asdict(recipe).items()}


def check_card(teacher, task, recipe, n, seed):
    """The card has that recipe, and its score is that of n starts on which no one chose a seed."""
    card, written, packages = teacher.card, teacher.card["score"], make_teachers.ENGINES.get(task, ())
    assert (card["task"], card["recipe"], teacher.task.name) == (task, in_json(recipe), task)
    assert card["learning_curve"][-1]["steps"] >= recipe.steps
    assert {*make_teachers.PACKAGES, *packages} == set(card["versions"])
    found = rollout_from_seed(teacher, task, n, seed=seed)
    assert abs(found.returns.mean() - written["mean"]) < 4 * written["std"] / n**0.5
    return found


ROBOT = pytest.param(CHEETAH, marks=pytest.mark.skipif(not find_spec("mujoco"), reason="needs mujoco"))


@pytest.mark.parametrize("task", [*TASKS, PENDULUM, LUNARLANDER, WALKER, ROBOT])
def test_a_shipped_teacher_is_what_its_card_says(task):
    teacher = load_teacher(task)
    card, written, (mean, failures) = teacher.card, teacher.card["score"], BARS[task]
    assert written["mean"] >= mean and 1 - written["goal"] <= failures
    means, tried = [point["mean"] for point in card["learning_curve"]], card["seeds_tried"][-1]
    assert tried["seed"] == card["seed"] and tried["mean"] == (max(means) if task in BEST_OF_CURVE else means[-1])
    assert card["sha256"] == atomic.sha256(SHIPPED / f"{task}.safetensors")
    n = {LUNARLANDER: 12, WALKER: 3, CHEETAH: 3}.get(task, 400)  # a physics engine takes longer
    check_card(teacher, task, RECIPES[task], n, seed=20_242)
    assert (Critics(teacher).criticality(np.zeros((3, len(teacher.task.low)))) >= 0).all()  # it has its critics with it


SHORT = Recipe(steps=90, batch_size=8, learning_starts=20, buffer_size=200)
EPISODIC = Recipe(
    steps=60, batch_size=8, train_freq=(1, "episode"), gradient_steps=-1, learning_starts=10, buffer_size=70,
    noise="ornstein-uhlenbeck", noise_std=0.5,
)  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(training, "CHUNK", 31)  # an odd number of updates, so that the delay of the policy matters
    for module in (training, make_teachers):
        monkeypatch.setattr(module, "RECIPES", {SIMPLEGOAL: SHORT, MOUNTAINCAR: SHORT})


def weights(path):
    return {name: t.numpy() for name, t in read_checkpoint(path)["parameters"]["policy"].items()}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


WANDERING = dataclasses.replace(SHORT, noise="ornstein-uhlenbeck", noise_std=0.5)  # noise with a memory


@pytest.mark.parametrize("recipe", [SHORT, EPISODIC, WANDERING])
def test_a_resumed_training_ends_with_the_same_weights(short, tmp_path, monkeypatch, recipe):
    monkeypatch.setattr(training, "RECIPES", {SIMPLEGOAL: recipe})
    whole = training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "whole", report=lambda line: None)
    lines = []

    def interrupt(line):
        lines.append(line)
        if len(lines) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=interrupt)
    cut = training.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=lines.append)
    assert same(weights(whole), weights(cut)) and len(lines) > 2
    if recipe is SHORT:
        other = training.train(SIMPLEGOAL, seed=4, cache=tmp_path / "whole", report=lambda line: None)
        assert not same(weights(whole), weights(other))


def test_a_damaged_checkpoint_is_not_resumed_and_a_whole_one_not_trained_again(short, tmp_path):
    path, lines = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None), []
    assert training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append) == path and not lines
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(atomic.DamagedFile, match="SHA-256 is .*delete it"):
        training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)


def test_a_changed_recipe_does_not_resume():
    for field in dataclasses.fields(Recipe):
        value = getattr(SHORT, field.name)
        altered = (2, "step") if isinstance(value, tuple) else "x" if isinstance(value, str) else value + 1
        assert dataclasses.replace(SHORT, **{field.name: altered}).id != SHORT.id


def test_where_training_rises_and_falls_the_best_of_the_curve_is_kept(short, tmp_path, monkeypatch):
    """The curve is made up: the second of three points is the best."""
    monkeypatch.setattr(training, "BEST_OF_CURVE", (SIMPLEGOAL,))
    monkeypatch.setattr(make_teachers, "BARS", {SIMPLEGOAL: (-1000.0, 1.0)})
    means, seen = iter([1.0, 3.0, 2.0]), []

    def score(model, task):
        seen.append({name: tensor.numpy().copy() for name, tensor in model.policy.state_dict().items()})
        return {"steps": model.num_timesteps, "mean": next(means)}

    monkeypatch.setattr(training, "_score", score)
    path = training.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    snapshot = read_checkpoint(path)
    assert len(seen) == 3 and same({n: t.numpy() for n, t in snapshot["kept"]["policy"].items()}, seen[1])
    assert same(weights(path), seen[2]) and not same(seen[1], seen[2])
    export(SIMPLEGOAL, path, tmp_path / "out")
    teacher = load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors")
    assert np.array_equal(teacher.layers[0][0].T, seen[1]["actor.mu.0.weight"])
    assert teacher.card["seeds_tried"] == [{"seed": 0, "steps": 62, "mean": 3.0}]


def test_a_teacher_below_the_bar_takes_nobodys_place(short, tmp_path, monkeypatch):
    monkeypatch.setattr(make_teachers, "BARS", {SIMPLEGOAL: (1000.0, 0.0)})
    with pytest.raises(command.CommandError, match="seed 0 does not meet the requirements"):
        called(main, "--cache", tmp_path / "cache", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists() and len(list((tmp_path / "cache").iterdir())) == 1


def test_a_bar_asks_for_a_mean_and_for_few_failures():
    for mean, goal, reached in ((16.3, 0.991, True), (16.29, 1.0, False), (17.0, 0.98, False)):
        score = {"mean": mean, "goal": goal, "pit": 1 - goal}
        assert make_teachers.reaches_bar(score, SIMPLEGOAL) == reached


# The shorter trainings of a study

SHIPPED_SHORT = [(task, seed) for task, seeds in make_teachers.SHORT_SEEDS.items() for seed in seeds]


def test_the_short_teachers_are_shipped_and_no_others():
    names = [f"{task}-{seed}" for task, seed in SHIPPED_SHORT]
    files = [path.name for path in (SHIPPED / "short").iterdir() if path.name != listed.MANIFEST]
    assert sorted(files) == sorted(f"{name}.{kind}" for name in names for kind in ("json", "safetensors"))
    digests = {load_teacher(SHIPPED / "short" / f"{name}.safetensors").digest for name in names}
    shipped = {load_teacher(task).digest for task in make_teachers.SHORT_SEEDS}
    assert len(digests | shipped) == len(names) + len(shipped)


@pytest.mark.parametrize(("task", "seed"), SHIPPED_SHORT)
def test_a_short_teacher_scores_what_its_card_says(task, seed):
    teacher = load_teacher(SHIPPED / "short" / f"{task}-{seed}.safetensors")
    card, goal, recipe = teacher.card, teacher.card["score"]["goal"], short_recipe(task)
    assert card["seed"] == seed and recipe.steps > card["learning_curve"][-2]["steps"]
    found = check_card(teacher, task, recipe, 200, seed=20_241)
    missed = np.mean(found.outcomes != GOAL)
    assert missed <= (1 - goal) + 4 * np.sqrt((1 - goal) / 200)


@pytest.fixture
def fewer_episodes(monkeypatch):
    score = training.score
    monkeypatch.setattr(training, "score", lambda teacher, task, n=40, *, seed=102: score(teacher, task, 40, seed=seed))
    monkeypatch.setattr(make_teachers, "SHORT_STEPS", {SIMPLEGOAL: 40, MOUNTAINCAR: 40})
    monkeypatch.setattr(make_teachers, "BARS", dict.fromkeys(TASKS, (1000.0, 0.0)))  # which nobody reaches


def test_make_short_teachers_trains_and_exports_actors_of_every_seed(short, fewer_episodes, tmp_path, monkeypatch):
    from safetensors.numpy import load_file

    monkeypatch.setattr(make_teachers, "SHORT_SEEDS", {SIMPLEGOAL: (4, 5), MOUNTAINCAR: (7,)})
    called(main, "--short", "--cache", tmp_path / "in", "--out", tmp_path / "out")
    cards = sorted((tmp_path / "out" / "short").glob("*.json"))  # nobody takes the shipped teacher's place
    assert [path.name for path in cards] == [f"{MOUNTAINCAR}-7.json", f"{SIMPLEGOAL}-4.json", f"{SIMPLEGOAL}-5.json"]
    teachers = [load_teacher(path.with_suffix(".safetensors")) for path in cards]
    assert [teacher.card["seed"] for teacher in teachers] == [7, 4, 5] and len({t.digest for t in teachers}) == 3
    checkpoint = tmp_path / "in" / f"{SIMPLEGOAL}-{short_recipe(SIMPLEGOAL).id}-5.pt"
    actor = {name: tensor for name, tensor in weights(checkpoint).items() if name.startswith("actor.")}
    assert same(load_file(cards[2].with_suffix(".safetensors")), actor) and len(actor) == 6
    card, scores = teachers[2].card, training.score(teachers[2], SIMPLEGOAL)
    assert card["recipe"] == dataclasses.asdict(SHORT) | {"steps": 40, "train_freq": [1, "step"]}
    assert [point["steps"] for point in card["learning_curve"]] == [31, 40] and "seeds_tried" not in card
    assert {name: card["score"][name] for name in scores} == scores
