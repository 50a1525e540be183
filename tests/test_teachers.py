import dataclasses
import io
import json
import pickle
import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, network_teacher

import vsp
from vsp import store, teachers
from vsp.envs import GOAL, PIT, get_task
from vsp.evaluate import outcomes
from vsp.store import DamagedFile
from vsp.teachers import BARS, RECIPES, SHIPPED, Recipe, Teacher, load_teacher

# Acting


def test_a_forward_pass_by_hand():
    weights = {  # one hidden layer: relu(x - y), relu(y); output tanh of (their difference, 1)
        "mu.0.weight": np.float32([[1, -1], [0, 1]]), "mu.0.bias": np.float32([0, 0]),
        "mu.2.weight": np.float32([[1, -1], [0, 0]]), "mu.2.bias": np.float32([0, 1]),
    }  # fmt: skip
    teacher = Teacher(weights, SIMPLEGOAL)
    action, state = teacher.predict(np.array([[0.75, 0.25], [0.25, 0.5]]))
    assert state is None and action.dtype == np.float32
    assert np.allclose(action, np.tanh([[0.5 - 0.25, 1], [0 - 0.5, 1]]), atol=1e-6)
    assert np.array_equal(teacher.predict(np.array([0.75, 0.25]))[0], action[0])


def test_actions_are_scaled_to_the_box_of_the_task():
    task = dataclasses.replace(get_task(MOUNTAINCAR), action_low=np.array([2.0]), action_high=np.array([6.0]))
    base, moved = network_teacher(MOUNTAINCAR), network_teacher(task)
    obs = np.random.default_rng(0).random((50, 2))
    assert np.allclose(moved.predict(obs)[0], 4 + 2 * base.predict(obs)[0], atol=1e-5)


def layer(inputs, outputs, weight=0.0):
    """The tensors of an actor without hidden layers."""
    return {"mu.0.weight": np.full((outputs, inputs), weight, "f4"), "mu.0.bias": np.zeros(outputs, "f4")}


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (layer(3, 2), "3 inputs and 2 outputs, SimpleGoal-v0 has 2 and 2"),
        (layer(2, 1), "2 inputs and 1 outputs, SimpleGoal-v0 has 2 and 2"),
        ({}, r"expected the tensors of a TD3 or DDPG actor"),
        ({"mu.weight": layer(2, 2)["mu.0.weight"]}, r"expected the tensors of a TD3 or DDPG actor"),
        ({"mu.0.weight": layer(2, 2)["mu.0.weight"]}, "mu.0.bias"),
        (layer(2, 2, np.nan), "nan.*expected finite"),
    ],
)  # fmt: skip
def test_weights_that_do_not_fit_are_one_clear_error(weights, message):
    with pytest.raises(ValueError, match=message):
        Teacher(weights, SIMPLEGOAL)


@pytest.mark.parametrize("obs", [np.zeros(3), np.zeros((4, 1)), [0.5, np.nan], [np.inf, 0.0], ["a", "b"], [None, 0.5]])
def test_a_bad_observation_is_one_clear_error(obs):
    with pytest.raises(ValueError, match="observations"):
        network_teacher(SIMPLEGOAL).predict(obs)


def test_the_digest_tells_teachers_apart_and_repeats():
    digests = [network_teacher(SIMPLEGOAL, seed=s).digest for s in (0, 0, 1)]
    assert digests[0] == digests[1] != digests[2] and len(digests[0]) == 64


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
    found = teachers.score(teacher, task)
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


def test_loading_and_acting_needs_no_torch():
    code = (
        "import sys, vsp; vsp.load_teacher('SimpleGoal-v0').predict([[0.5, 0.5]])\n"
        "print({'torch', 'stable_baselines3'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=store.ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr


# Files


@pytest.fixture
def copied(tmp_path):
    for suffix in (".safetensors", ".json"):
        shutil.copy(SHIPPED / f"{SIMPLEGOAL}{suffix}", tmp_path / f"own{suffix}")
    return tmp_path / "own.safetensors"


def test_a_path_loads_as_the_name_does(copied):
    shipped, own = load_teacher(SIMPLEGOAL), load_teacher(copied)
    assert own.digest == shipped.digest == load_teacher(str(copied), SIMPLEGOAL).digest and own.task is shipped.task


@pytest.mark.parametrize("size", [0, 7, 8, 1000, -1])
def test_truncated_weights_are_refused(copied, size):
    copied.write_bytes(copied.read_bytes()[:size])
    with pytest.raises(DamagedFile, match="own.safetensors: SHA-256 is .*its card says"):
        load_teacher(copied)


@pytest.mark.parametrize("position", [0, 9, 1000, 700_000, -1])
def test_one_altered_bit_is_refused(copied, position):
    content = bytearray(copied.read_bytes())
    content[position] ^= 16
    copied.write_bytes(content)
    with pytest.raises(DamagedFile, match="own.safetensors: SHA-256 is .*its card says"):
        load_teacher(copied)


def test_missing_weights_or_card_are_named(copied, tmp_path):
    with pytest.raises(FileNotFoundError, match="other.safetensors: no such file"):
        load_teacher(tmp_path / "other.safetensors")
    copied.with_suffix(".json").unlink()
    with pytest.raises(FileNotFoundError, match="own.json: no such file"):
        load_teacher(copied)
    with pytest.raises(FileNotFoundError, match="agent.zip: no such file"):
        load_teacher(tmp_path / "agent.zip", SIMPLEGOAL)


def test_a_teacher_of_another_task_is_refused(copied):
    with pytest.raises(ValueError, match="2 inputs and 2 outputs, MountainCarContinuous-v0 has 2 and 1"):
        load_teacher(copied, MOUNTAINCAR)


@pytest.mark.parametrize("card", [{}, {"task": "SimpelGoal-v0"}, {"task": None}])
def test_a_card_without_a_known_task_is_one_clear_error(copied, card):
    store.write_carded(copied, copied.read_bytes(), card)
    with pytest.raises(ValueError, match="task"):
        load_teacher(copied)


def test_unknown_names_are_one_clear_error():
    with pytest.raises(ValueError, match="unknown task 'SimpleGoal', expected one of .*did you mean 'SimpleGoal-v0'"):
        load_teacher("SimpleGoal")
    with pytest.raises(ValueError, match="weights.pth: expected a .safetensors file, a .zip, or the name of a task"):
        load_teacher("weights.pth")


def test_sealed_bytes_that_are_no_safetensors_are_refused(tmp_path):
    store.write_carded(tmp_path / "x.safetensors", b"not tensors", {"task": SIMPLEGOAL})
    with pytest.raises(DamagedFile, match="x.safetensors"):
        load_teacher(tmp_path / "x.safetensors")


# Zips of Stable-Baselines3


@pytest.fixture(scope="module")
def agents(tmp_path_factory):
    """Untrained agents, by name, and the zips that Stable-Baselines3 saved."""
    import gymnasium
    import torch
    from stable_baselines3 import PPO, SAC, TD3

    folder, small = tmp_path_factory.mktemp("agents"), {"net_arch": [16, 12]}
    env = gymnasium.make(SIMPLEGOAL)
    made = {
        "td3": TD3("MlpPolicy", env, seed=0, buffer_size=10, device="cpu"),
        "small": TD3("MlpPolicy", env, seed=1, buffer_size=10, policy_kwargs=dict(small), device="cpu"),
        "car": TD3(
            "MlpPolicy", gymnasium.make(MOUNTAINCAR), seed=1, buffer_size=10, policy_kwargs=dict(small), device="cpu"
        ),
        "tanh": TD3(
            "MlpPolicy", env, buffer_size=10, policy_kwargs={**small, "activation_fn": torch.nn.Tanh}, device="cpu"
        ),
        "sac": SAC("MlpPolicy", env, buffer_size=10, policy_kwargs=dict(small), device="cpu"),
        "ppo": PPO("MlpPolicy", env, policy_kwargs=dict(small), device="cpu"),
    }
    for name, agent in made.items():
        agent.save(folder / f"{name}.zip")
    return made, folder


@pytest.mark.parametrize(("name", "task"), [("td3", SIMPLEGOAL), ("small", SIMPLEGOAL), ("car", MOUNTAINCAR)])
def test_a_zip_predicts_as_stable_baselines_does(agents, name, task):
    made, folder = agents
    teacher = load_teacher(folder / f"{name}.zip", task)
    obs = np.random.default_rng(0).uniform(get_task(task).low, get_task(task).high, size=(500, 2)).astype(np.float32)
    expected, _ = made[name].predict(obs, deterministic=True)
    assert np.abs(teacher.predict(obs)[0] - expected).max() < 1e-6
    assert np.abs(teacher.predict(obs[0])[0] - expected[0]).max() < 1e-6
    assert (outcomes(teacher, task, 3, seed=0).lengths > 0).all()


@pytest.mark.parametrize(
    ("name", "task", "message"),
    [
        ("td3", None, "say which task the agent is for"),
        ("td3", MOUNTAINCAR, "2 inputs and 2 outputs, MountainCarContinuous-v0 has 2 and 1"),
        ("td3", "SimpelGoal-v0", "did you mean"),
        ("tanh", SIMPLEGOAL, "activation is .*Tanh.*, expected ReLU"),
        ("ppo", SIMPLEGOAL, "expected the tensors of a TD3 or DDPG actor"),
        ("sac", SIMPLEGOAL, "expected the tensors of a TD3 or DDPG actor"),
    ],
)
def test_a_zip_that_does_not_fit_is_one_clear_error(agents, name, task, message):
    with pytest.raises(ValueError, match=message):
        load_teacher(agents[1] / f"{name}.zip", task)


def rewritten(source, target, **parts):
    """A copy of a zip with some of its parts replaced (None: left out)."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = parts.get(name.replace(".", "_"), old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def payloads(path):
    import torch

    buffer = io.BytesIO()
    torch.save({"actor.mu.0.weight": Payload(path)}, buffer)
    return [pickle.dumps(Payload(path)), buffer.getvalue()]


@pytest.mark.parametrize("kind", [0, 1])
def test_a_payload_in_a_zip_is_not_run(agents, tmp_path, kind):
    mark = tmp_path / "ran"
    bad = rewritten(agents[1] / "small.zip", tmp_path / "bad.zip", policy_pth=payloads(mark)[kind])
    with pytest.raises(DamagedFile, match="bad.zip: not a zip of a Stable-Baselines3 agent"):
        load_teacher(bad, SIMPLEGOAL)
    assert not mark.exists()
    pickle.loads(pickle.dumps(Payload(mark))).close()
    assert mark.exists()  # the payload is live


def test_a_payload_in_the_data_of_a_zip_is_not_run(agents, tmp_path):
    import base64

    mark = tmp_path / "ran"
    serialised = base64.b64encode(pickle.dumps(Payload(mark))).decode()
    with zipfile.ZipFile(agents[1] / "small.zip") as archive:
        data = json.loads(archive.read("data"))
    data["policy_class"] = {":type:": "x", ":serialized:": serialised}
    load_teacher(rewritten(agents[1] / "small.zip", tmp_path / "x.zip", data=json.dumps(data)), SIMPLEGOAL)
    assert not mark.exists()


@pytest.mark.parametrize(
    "parts",
    [
        {"data": None}, {"data": b"{"}, {"data": b"[]"}, {"data": b"3"},
        {"policy_pth": None}, {"policy_pth": b""}, {"policy_pth": b"zzz"},
    ],
)  # fmt: skip
def test_a_zip_without_its_parts_is_refused(agents, tmp_path, parts):
    with pytest.raises(DamagedFile, match="x.zip"):
        load_teacher(rewritten(agents[1] / "small.zip", tmp_path / "x.zip", **parts), SIMPLEGOAL)


def test_a_policy_that_is_no_dictionary_of_tensors_is_refused(agents, tmp_path):
    import torch

    for content in (torch.zeros(3), [1, 2], {"actor.mu.0.weight": "text"}):
        buffer = io.BytesIO()
        torch.save(content, buffer)
        bad = rewritten(agents[1] / "small.zip", tmp_path / "x.zip", policy_pth=buffer.getvalue())
        with pytest.raises(ValueError):
            load_teacher(bad, SIMPLEGOAL)


def test_a_damaged_zip_is_refused_or_harmless(agents, tmp_path):
    """Truncated: refused. One bit: refused with a clear error, or outside what is read and without effect."""
    content, path = (agents[1] / "small.zip").read_bytes(), tmp_path / "x.zip"
    expected = load_teacher(agents[1] / "small.zip", SIMPLEGOAL).digest
    for size in np.linspace(0, len(content) - 1, 12, dtype=int):
        path.write_bytes(content[:size])
        with pytest.raises(DamagedFile):
            load_teacher(path, SIMPLEGOAL)
    for position in np.linspace(0, len(content) - 1, 400, dtype=int):
        path.write_bytes(content[:position] + bytes([content[position] ^ 1 << position % 8]) + content[position + 1 :])
        try:
            assert load_teacher(path, SIMPLEGOAL).digest == expected, position
        except ValueError as error:
            assert "x.zip" in str(error), position


# Training


SHORT = Recipe(steps=90, batch_size=8, learning_starts=20, buffer_size=200)
EPISODIC = Recipe(
    steps=60, batch_size=8, train_freq=(1, "episode"), gradient_steps=-1, learning_starts=10, buffer_size=70,
    noise="ornstein-uhlenbeck", noise_std=0.5,
)  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(teachers, "CHUNK", 31)  # an odd number of updates, so that the delay of the policy matters
    monkeypatch.setattr(teachers, "RECIPES", {SIMPLEGOAL: SHORT, MOUNTAINCAR: SHORT})


def weights(path):
    import torch

    return {name: t.numpy() for name, t in torch.load(path, weights_only=True)["policy"].items()}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


WANDERING = dataclasses.replace(SHORT, noise="ornstein-uhlenbeck", noise_std=0.5)  # noise with a memory


@pytest.mark.parametrize("recipe", [SHORT, EPISODIC, WANDERING])
@pytest.mark.parametrize("stop_after", [2])
def test_a_resumed_training_ends_with_the_same_weights(short, tmp_path, monkeypatch, recipe, stop_after):
    monkeypatch.setattr(teachers, "RECIPES", {SIMPLEGOAL: recipe})
    whole = teachers.train(SIMPLEGOAL, seed=3, cache=tmp_path / "whole", report=lambda line: None)
    lines = []

    def interrupt(line):
        lines.append(line)
        if len(lines) == stop_after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        teachers.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=interrupt)
    cut = teachers.train(SIMPLEGOAL, seed=3, cache=tmp_path / "cut", report=lines.append)
    assert same(weights(whole), weights(cut)) and len(lines) > stop_after
    other = teachers.train(SIMPLEGOAL, seed=4, cache=tmp_path / "whole", report=lambda line: None)
    assert not same(weights(whole), weights(other))


def test_a_finished_training_is_not_done_again(short, tmp_path):
    first, lines = teachers.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None), []
    before = first.read_bytes()
    again = teachers.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert again == first and not lines and again.read_bytes() == before


def test_a_changed_recipe_or_seed_does_not_resume(short, tmp_path, monkeypatch):
    path = teachers.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lambda line: None)
    lines, changed = [], dataclasses.replace(SHORT, noise_std=0.2)
    monkeypatch.setattr(teachers, "RECIPES", {SIMPLEGOAL: changed})
    other = teachers.train(SIMPLEGOAL, seed=0, cache=tmp_path, report=lines.append)
    assert other != path and len(lines) == 3 and path.exists()
    for field in dataclasses.fields(Recipe):
        value = getattr(SHORT, field.name)
        altered = (2, "step") if isinstance(value, tuple) else "x" if isinstance(value, str) else value + 1
        assert dataclasses.replace(SHORT, **{field.name: altered}).id != SHORT.id


def test_export_writes_what_load_teacher_reads(short, tmp_path, monkeypatch):
    monkeypatch.setattr(teachers, "BARS", {SIMPLEGOAL: (-100.0, 1.0)})
    paths = {seed: teachers.train(SIMPLEGOAL, seed=seed, cache=tmp_path, report=lambda line: None) for seed in (0, 1)}
    reached = teachers.export(SIMPLEGOAL, paths, tmp_path / "out")
    teacher = load_teacher(tmp_path / "out" / f"{SIMPLEGOAL}.safetensors")
    assert reached and teacher.card["seed"] == 1 and [t["seed"] for t in teacher.card["seeds_tried"]] == [0, 1]
    assert np.array_equal(teacher.layers[0][0].T, weights(paths[1])["actor.mu.0.weight"])
    assert [point["steps"] for point in teacher.card["learning_curve"]] == [31, 62, 90]
    found = teachers.score(teacher, SIMPLEGOAL)
    assert {name: teacher.card["score"][name] for name in found} == found


def test_a_teacher_below_the_bar_takes_nobodys_place(short, tmp_path, monkeypatch):
    monkeypatch.setattr(teachers, "BARS", {SIMPLEGOAL: (1000.0, 0.0)})
    monkeypatch.setattr(teachers, "MOST_SEEDS", 2)
    out = tmp_path / "out"
    monkeypatch.setattr("sys.argv", ["x", "--cache", str(tmp_path / "cache"), "--out", str(out), "--task", SIMPLEGOAL])
    with pytest.raises(SystemExit, match="none of the seeds 0 to 1 reached the bar"):
        teachers.main()
    assert not out.exists() and len(list((tmp_path / "cache").iterdir())) == 2


@pytest.mark.parametrize(
    ("task", "mean", "goal", "reached"),
    [
        (SIMPLEGOAL, 16.3, 0.991, True), (SIMPLEGOAL, 16.29, 1.0, False), (SIMPLEGOAL, 17.0, 0.98, False),
        (MOUNTAINCAR, 93.3, 1.0, True), (MOUNTAINCAR, 95.0, 0.9999, False), (MOUNTAINCAR, 93.29, 1.0, False),
    ],
)  # fmt: skip
def test_reaches_bar(task, mean, goal, reached):
    assert teachers.reaches_bar({"mean": mean, "goal": goal, "pit": 1 - goal}, task) == reached


def test_the_recipes_are_those_of_the_paper():
    goal, car = RECIPES[SIMPLEGOAL], RECIPES[MOUNTAINCAR]
    assert (goal.steps, goal.batch_size, goal.train_freq) == (500_000, 256, (1, "step"))
    assert (car.steps, car.noise, car.noise_std, car.batch_size) == (300_000, "ornstein-uhlenbeck", 0.5, 100)
    assert (car.train_freq, car.gradient_steps, car.learning_rate) == ((1, "episode"), -1, 1e-3)
    assert vsp.load_teacher is load_teacher
