import dataclasses
from importlib.util import find_spec

import numpy as np
import pytest
from support import CHEETAH, LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, WALKER

import vsp
from vsp.evaluation import rollout_from_seed
from vsp.run import atomic, listed, sealed
from vsp.tasks.base import GOAL
from vsp.teachers import train
from vsp.teachers.teacher import SHIPPED, load_teacher
from vsp.teachers.train import BARS, BEST_OF_CURVE, RECIPES, Recipe, export, main, read_checkpoint, short_recipe


@pytest.fixture(autouse=True)
def denormal_numbers():
    """Training flushes them to zero, in the whole process; the tests that come next may need them."""
    yield
    import torch

    torch.set_flush_denormal(False)


# Shipped


def in_json(recipe):
    return {key: list(v) if isinstance(v, tuple) else v for key, v in dataclasses.asdict(recipe).items()}


ROBOT = pytest.param(CHEETAH, marks=pytest.mark.skipif(not find_spec("mujoco"), reason="needs mujoco"))


@pytest.mark.parametrize("task", [*TASKS, PENDULUM, LUNARLANDER, WALKER, ROBOT])
def test_a_shipped_teacher_is_what_its_card_says(task):
    teacher = load_teacher(task)
    card, written, (mean, failures) = teacher.card, teacher.card["score"], BARS[task]
    assert (card["task"], card["recipe"]) == (task, in_json(RECIPES[task]))
    assert written["mean"] >= mean and 1 - written["goal"] <= failures
    steps, means = zip(*((point["steps"], point["mean"]) for point in card["learning_curve"]))
    assert steps[-1] >= card["recipe"]["steps"]
    tried = card["seeds_tried"][-1]
    assert tried["seed"] == card["seed"] and tried["mean"] == (max(means) if task in BEST_OF_CURVE else means[-1])
    assert {*train.PACKAGES, *train.ENGINES.get(task, ())} == set(card["versions"])
    assert card["sha256"] == atomic.sha256(SHIPPED / f"{task}.safetensors")
    n = {LUNARLANDER: 12, WALKER: 3, CHEETAH: 3}.get(task, 400)  # a physics engine takes longer
    found = rollout_from_seed(teacher, task, n, seed=20_242)  # starts that no one chose a seed on
    assert abs(found.returns.mean() - written["mean"]) < 4 * written["std"] / n**0.5
    assert (teacher.criticality(np.zeros((3, len(teacher.task.low)))) >= 0).all()  # it has its critics with it


SHORT = Recipe(steps=90, batch_size=8, learning_starts=20, buffer_size=200)
EPISODIC = Recipe(
    steps=60, batch_size=8, train_freq=(1, "episode"), gradient_steps=-1, learning_starts=10, buffer_size=70,
    noise="ornstein-uhlenbeck", noise_std=0.5,
)  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(train, "CHUNK", 31)  # an odd number of updates, so that the delay of the policy matters
    monkeypatch.setattr(train, "RECIPES", {SIMPLEGOAL: SHORT, MOUNTAINCAR: SHORT})


def weights(path):
    return {name: t.numpy() for name, t in read_checkpoint(path)["policy"].items()}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


WANDERING = dataclasses.replace(SHORT, noise="ornstein-uhlenbeck", noise_std=0.5)  # noise with a memory


@pytest.mark.parametrize("recipe", [SHORT, EPISODIC, WANDERING])
@pytest.mark.parametrize("stop_after", [2])
def test_a_resumed_training_ends_with_the_same_weights(short, tmp_path, monkeypatch, recipe, stop_after):
    monkeypatch.setattr(train, "RECIPES", {SIMPLEGOAL: recipe})
    whole = train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "whole", report=lambda line: None)
    lines = []

    def interrupt(line):
        lines.append(line)
        if len(lines) == stop_after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=interrupt)
    cut = train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=lines.append)
    assert same(weights(whole), weights(cut)) and len(lines) > stop_after
    if recipe is SHORT:
        other = train.train(SIMPLEGOAL, seed=4, cache=tmp_path / "whole", report=lambda line: None)
        assert not same(weights(whole), weights(other))


def test_on_another_machine_a_training_goes_on_without_its_replay_buffer(short, tmp_path, monkeypatch):
    """Networks, optimisers and the learning curve move; the actor fills a new buffer, and the card says so."""
    lines, lean = [], tmp_path / "lean"

    def interrupt(line):
        lines.append(line)
        if len(lines) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "here", lean=lean, report=interrupt)
    (moved,) = lean.iterdir()
    before = read_checkpoint(moved)
    assert "buffer" not in before and before["counters"][0] == 31  # the second point was not written any more
    path = train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "there", lean=lean, report=lines.append)
    after = read_checkpoint(path)
    assert [point["steps"] for point in after["curve"]] == [31, 62, 90] and after["refilled"] == [31]
    assert len(after["buffer"]["rewards"]) == 90 - 31 + SHORT.learning_starts
    assert read_checkpoint(moved)["curve"] == after["curve"]
    path.unlink()
    assert train.train(SIMPLEGOAL, seed=3, cache=tmp_path / "there", lean=lean, report=pytest.fail) == moved
    monkeypatch.setattr(train, "BARS", {SIMPLEGOAL: (-100.0, 1.0)})
    assert export(SIMPLEGOAL, {3: moved}, tmp_path / "out")
    assert load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors").card["buffer_refilled_at"] == [31]


def test_a_finished_training_is_not_done_again(short, tmp_path):
    first, lines = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None), []
    before = first.read_bytes()
    again = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert again == first and not lines and again.read_bytes() == before


def test_a_damaged_checkpoint_is_not_resumed(short, tmp_path, monkeypatch):
    path = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    content = path.read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr("torch.load", lambda *given: pytest.fail("parsed"))
        for damaged in (content[:-1], content[:50], b"", content[:5000] + b"?" + content[5001:]):
            path.write_bytes(damaged)
            with pytest.raises(atomic.DamagedFile, match="SHA-256 is .*delete it"):
                read_checkpoint(path)
        with pytest.raises(atomic.DamagedFile):
            train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    sealed.write_sealed(path, b"no tensors")
    with pytest.raises(atomic.DamagedFile, match="the checksum is right, but the file is no checkpoint"):
        read_checkpoint(path)


def test_a_changed_recipe_or_seed_does_not_resume(short, tmp_path, monkeypatch):
    path = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    lines, changed = [], dataclasses.replace(SHORT, noise_std=0.2)
    monkeypatch.setattr(train, "RECIPES", {SIMPLEGOAL: changed})
    other = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert other != path and len(lines) == 3 and path.exists()
    for field in dataclasses.fields(Recipe):
        value = getattr(SHORT, field.name)
        altered = (2, "step") if isinstance(value, tuple) else "x" if isinstance(value, str) else value + 1
        assert dataclasses.replace(SHORT, **{field.name: altered}).id != SHORT.id


def test_export_writes_what_load_teacher_reads(short, tmp_path, monkeypatch):
    monkeypatch.setattr(train, "BARS", {SIMPLEGOAL: (-100.0, 1.0)})
    paths = {seed: train.train(SIMPLEGOAL, seed=seed, cache=tmp_path, report=lambda line: None) for seed in (0, 1)}
    reached = export(SIMPLEGOAL, paths, tmp_path / "out")
    teacher = load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors")
    assert reached and teacher.card["seed"] == 1 and [t["seed"] for t in teacher.card["seeds_tried"]] == [0, 1]
    assert np.array_equal(teacher.layers[0][0].T, weights(paths[1])["actor.mu.0.weight"])
    assert [point["steps"] for point in teacher.card["learning_curve"]] == [31, 62, 90]
    found = train.score(teacher, SIMPLEGOAL)
    assert {name: teacher.card["score"][name] for name in found} == found


def test_where_training_rises_and_falls_the_best_of_the_curve_is_kept(short, tmp_path, monkeypatch):
    """The curve is made up: the second of three points is the best."""
    monkeypatch.setattr(train, "BEST_OF_CURVE", (SIMPLEGOAL,))
    monkeypatch.setattr(train, "BARS", {SIMPLEGOAL: (-1000.0, 1.0)})
    means, seen = iter([1.0, 3.0, 2.0]), []

    def score(model, task):
        seen.append({name: tensor.numpy().copy() for name, tensor in model.policy.state_dict().items()})
        return {"steps": model.num_timesteps, "mean": next(means)}

    monkeypatch.setattr(train, "_score", score)
    path = train.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    snapshot = read_checkpoint(path)
    assert len(seen) == 3 and same({n: t.numpy() for n, t in snapshot["best"]["policy"].items()}, seen[1])
    assert same({n: t.numpy() for n, t in snapshot["policy"].items()}, seen[2]) and not same(seen[1], seen[2])
    assert export(SIMPLEGOAL, {0: path}, tmp_path / "out")
    teacher = load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors")
    assert np.array_equal(teacher.layers[0][0].T, seen[1]["actor.mu.0.weight"])
    assert teacher.card["seeds_tried"] == [{"seed": 0, "steps": 62, "mean": 3.0}]


def test_where_a_physics_engine_plays_episodes_are_fewer(monkeypatch):
    asked = []

    def play(teacher, task, n, *, seed):
        asked.append(n)
        return rollout_from_seed(teacher, SIMPLEGOAL, 5, seed=seed)

    monkeypatch.setattr(train, "rollout_from_seed", play)
    for task in (SIMPLEGOAL, "LunarLanderContinuous-v3"):
        train.score(load_teacher(SIMPLEGOAL), task, 500)
    assert asked == [500, 50]


def test_a_teacher_below_the_bar_takes_nobodys_place(short, tmp_path, monkeypatch):
    monkeypatch.setattr(train, "BARS", {SIMPLEGOAL: (1000.0, 0.0)})
    monkeypatch.setattr(train, "MOST_SEEDS", 2)
    out = tmp_path / "out"
    monkeypatch.setattr("sys.argv", ["x", "--cache", str(tmp_path / "cache"), "--out", str(out), "--task", SIMPLEGOAL])
    with pytest.raises(SystemExit, match="none of the seeds 0 to 1 met the requirements"):
        main()
    assert not out.exists() and len(list((tmp_path / "cache").iterdir())) == 2


@pytest.mark.parametrize("more", [["--lean", "x"], ["--task", "LunarLanderContinuous-v3"]])
def test_short_trainings_refuse_what_they_cannot_use(monkeypatch, capsys, more):
    monkeypatch.setattr("sys.argv", ["x", "--cache", "c", "--short", *more])
    with pytest.raises(SystemExit):
        main()
    assert "argument --short: it takes no --lean, and a --task of ['SimpleGoal-v0'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("task", "mean", "goal", "reached"),
    [
        (SIMPLEGOAL, 16.3, 0.991, True), (SIMPLEGOAL, 16.29, 1.0, False), (SIMPLEGOAL, 17.0, 0.98, False),
        (MOUNTAINCAR, 93.3, 1.0, True), (MOUNTAINCAR, 95.0, 0.9999, False), (MOUNTAINCAR, 93.29, 1.0, False),
    ],
)  # fmt: skip
def test_reaches_bar(task, mean, goal, reached):
    assert train.reaches_bar({"mean": mean, "goal": goal, "pit": 1 - goal}, task) == reached


def test_the_recipes_are_those_of_the_paper():
    goal, car = RECIPES[SIMPLEGOAL], RECIPES[MOUNTAINCAR]
    assert (goal.steps, goal.batch_size, goal.train_freq) == (500_000, 256, (1, "step"))
    assert (car.steps, car.noise, car.noise_std, car.batch_size) == (300_000, "ornstein-uhlenbeck", 0.5, 100)
    assert (car.train_freq, car.gradient_steps, car.learning_rate) == ((1, "episode"), -1, 1e-3)
    assert vsp.load_teacher is load_teacher


# The shorter trainings of a study

SHIPPED_SHORT = [(task, seed) for task, seeds in train.SHORT_SEEDS.items() for seed in seeds]


@pytest.mark.parametrize("task", TASKS)
def test_the_short_recipe_is_that_of_the_shipped_teacher_with_fewer_steps(task):
    recipe = short_recipe(task)
    assert recipe.steps < RECIPES[task].steps and recipe.id != RECIPES[task].id
    assert dataclasses.replace(recipe, steps=RECIPES[task].steps) == RECIPES[task]


def test_the_short_teachers_are_shipped_and_no_others():
    names = [f"{task}-{seed}" for task, seed in SHIPPED_SHORT]
    files = [path.name for path in (SHIPPED / "short").iterdir() if path.name != listed.MANIFEST]
    assert sorted(files) == sorted(f"{name}.{kind}" for name in names for kind in ("json", "safetensors"))
    digests = {load_teacher(SHIPPED / "short" / f"{name}.safetensors").digest for name in names}
    shipped = {load_teacher(task).digest for task in train.SHORT_SEEDS}
    assert len(digests | shipped) == len(names) + len(shipped)


@pytest.mark.parametrize(("task", "seed"), SHIPPED_SHORT)
def test_a_short_teacher_scores_what_its_card_says(task, seed):
    teacher = load_teacher(SHIPPED / "short" / f"{task}-{seed}.safetensors")
    card, written = teacher.card, teacher.card["score"]
    recipe = in_json(short_recipe(task))
    assert (card["task"], card["seed"], card["recipe"], teacher.task.name) == (task, seed, recipe, task)
    assert card["learning_curve"][-1]["steps"] >= recipe["steps"] > card["learning_curve"][-2]["steps"]
    assert {*train.PACKAGES, *train.ENGINES.get(task, ())} == set(card["versions"])
    found = rollout_from_seed(teacher, task, 200, seed=20_241)  # starts that no one has seen
    assert abs(found.returns.mean() - written["mean"]) < 4 * written["std"] / np.sqrt(200)
    missed = np.mean(found.outcomes != GOAL)
    assert missed <= (1 - written["goal"]) + 4 * np.sqrt((1 - written["goal"]) / 200)


@pytest.fixture
def fewer_episodes(monkeypatch):
    score = train.score
    monkeypatch.setattr(train, "score", lambda teacher, task, n=40, *, seed=102: score(teacher, task, 40, seed=seed))
    monkeypatch.setattr(train, "SHORT_STEPS", {SIMPLEGOAL: 40, MOUNTAINCAR: 40})
    monkeypatch.setattr(train, "BARS", dict.fromkeys(TASKS, (1000.0, 0.0)))  # which nobody reaches


def test_the_export_of_a_short_training_is_an_actor_and_its_card(short, fewer_episodes, tmp_path):
    from safetensors.numpy import load_file

    recipe = short_recipe(SIMPLEGOAL)
    checkpoint = train.train(SIMPLEGOAL, seed=6, cache=tmp_path, recipe=recipe, report=lambda line: None)
    assert train.export_short(SIMPLEGOAL, 6, checkpoint, tmp_path / "out") is None
    path = tmp_path / "out" / "short" / f"{SIMPLEGOAL}-6.safetensors"
    made = [path.with_name(listed.MANIFEST), path.with_suffix(".json"), path]
    assert sorted(file for file in tmp_path.glob("out/**/*") if file.is_file()) == made
    actor = {name: tensor for name, tensor in weights(checkpoint).items() if name.startswith("actor.")}
    assert same(load_file(path), actor) and len(actor) == 6
    teacher = load_teacher(path)
    assert teacher.card["recipe"] == dataclasses.asdict(SHORT) | {"steps": 40, "train_freq": [1, "step"]}
    assert (teacher.card["task"], teacher.card["seed"]) == (SIMPLEGOAL, 6) and "seeds_tried" not in teacher.card
    assert [point["steps"] for point in teacher.card["learning_curve"]] == [31, 40]
    found = train.score(teacher, SIMPLEGOAL)
    assert {name: teacher.card["score"][name] for name in found} == found


def test_make_short_teachers_trains_and_exports_every_seed(short, fewer_episodes, tmp_path, monkeypatch):
    monkeypatch.setattr(train, "SHORT_SEEDS", {SIMPLEGOAL: (4, 5), MOUNTAINCAR: (7,)})
    arguments = ["x", "--short", "--cache", str(tmp_path / "cache"), "--out", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", arguments)
    main()
    assert len(list((tmp_path / "cache").iterdir())) == 3
    cards = sorted((tmp_path / "out").rglob("*.json"))
    assert [path.name for path in cards] == [f"{MOUNTAINCAR}-7.json", f"{SIMPLEGOAL}-4.json", f"{SIMPLEGOAL}-5.json"]
    assert {path.parent.name for path in cards} == {"short"}  # nobody takes the shipped teacher's place
    teachers = [load_teacher(path.with_suffix(".safetensors")) for path in cards]
    assert [teacher.card["seed"] for teacher in teachers] == [7, 4, 5] and len({t.digest for t in teachers}) == 3
    assert {(t.card["recipe"]["steps"], t.card["learning_curve"][-1]["steps"]) for t in teachers} == {(40, 40)}
