import contextlib
import dataclasses
import io
import os
import pickle
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, network_teacher

from vsp.evaluation import rollout_from_seed
from vsp.run import atomic, listed
from vsp.run.atomic import DamagedFile
from vsp.tasks.registry import get_task
from vsp.teachers.teacher import SHIPPED, Teacher, load_teacher

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
        ({}, r"expected the tensors of a TD3 or DDPG actor"),
        ({"mu.0.weight": layer(2, 2)["mu.0.weight"]}, "mu.0.bias"),
        (layer(2, 2, np.nan), "nan.*expected finite"),
        ({**layer(2, 2), "mu.0.bias": np.full(2, 1e300)}, r"mu.0.bias hold 1e\+300, expected .* at most 1000000"),
    ],
)  # fmt: skip
def test_weights_that_do_not_fit_are_one_clear_error(weights, message):
    with pytest.raises(ValueError, match=message):
        Teacher(weights, SIMPLEGOAL)


def test_the_digest_tells_teachers_apart_and_repeats():
    digests = [network_teacher(SIMPLEGOAL, seed=s).digest for s in (0, 0, 1)]
    assert digests[0] == digests[1] != digests[2] and len(digests[0]) == 64


# Files


@pytest.fixture
def copied(tmp_path):
    for suffix in (".safetensors", ".json"):
        listed.write_listed(tmp_path / f"own{suffix}", (SHIPPED / f"{SIMPLEGOAL}{suffix}").read_bytes())
    return tmp_path / "own.safetensors"


def test_a_path_loads_as_the_name_does(copied):
    shipped, own = load_teacher(SIMPLEGOAL), load_teacher(copied)
    assert own.digest == shipped.digest == load_teacher(str(copied), SIMPLEGOAL).digest and own.task is shipped.task


def test_a_teacher_of_another_task_is_refused(copied):
    with pytest.raises(ValueError, match="2 inputs and 2 outputs, MountainCarContinuous-v0 has 2 and 1"):
        load_teacher(copied, MOUNTAINCAR)


@pytest.mark.parametrize("position", [0, 1000, -1])
def test_damaged_weights_are_refused(copied, position):
    content = copied.read_bytes()
    altered = bytearray(content)
    altered[position] ^= 16
    for damaged in (content[:position], altered):
        copied.write_bytes(damaged)
        with pytest.raises(DamagedFile, match="own.safetensors: SHA-256 is"):
            load_teacher(copied)


def test_missing_weights_or_card_are_named(copied, tmp_path):
    with pytest.raises(FileNotFoundError, match="other.safetensors: no such file"):
        load_teacher(tmp_path / "other.safetensors")
    copied.with_suffix(".json").unlink()
    with pytest.raises(FileNotFoundError, match="own.json: no such file"):
        load_teacher(copied)
    with pytest.raises(FileNotFoundError, match="agent.zip: no such file"):
        load_teacher(tmp_path / "agent.zip", SIMPLEGOAL)


def test_a_card_without_a_known_task_is_one_clear_error(copied):
    listed.write_listed(copied.with_suffix(".json"), '{"task": "SimpelGoal-v0"}')
    with pytest.raises(ValueError, match="task"):
        load_teacher(copied)


# Zips of Stable-Baselines3


@pytest.fixture(scope="module")
def agents(tmp_path_factory):
    """Untrained agents, by name, and the zips that Stable-Baselines3 saved."""
    import gymnasium
    import torch
    from stable_baselines3 import DDPG, SAC, TD3

    def untrained(algorithm, task=SIMPLEGOAL, **network):
        about = {"seed": 0, "device": "cpu", "buffer_size": 10}
        return algorithm("MlpPolicy", gymnasium.make(task), policy_kwargs=network, **about)

    folder, small = tmp_path_factory.mktemp("agents"), {"net_arch": [16, 12]}
    made = {
        "td3": untrained(TD3),
        "small": untrained(TD3, **small),
        "car": untrained(TD3, MOUNTAINCAR, **small),
        "ddpg": untrained(DDPG, **small),
        "tanh": untrained(TD3, **small, activation_fn=torch.nn.Tanh),
        "leaky": untrained(TD3, **small, activation_fn=torch.nn.LeakyReLU),
        "sac": untrained(SAC, **small),
    }
    for name, agent in made.items():
        agent.save(folder / f"{name}.zip")
    return made, folder


@pytest.mark.parametrize(("name", "task"), [("td3", SIMPLEGOAL), ("car", MOUNTAINCAR), ("ddpg", SIMPLEGOAL)])
def test_a_zip_predicts_as_stable_baselines_does(agents, name, task):
    made, folder = agents
    teacher = load_teacher(folder / f"{name}.zip", task)
    obs = np.random.default_rng(0).uniform(get_task(task).low, get_task(task).high, size=(500, 2)).astype(np.float32)
    expected, _ = made[name].predict(obs, deterministic=True)
    assert np.abs(teacher.predict(obs)[0] - expected).max() < 1e-6
    assert np.abs(teacher.predict(obs[0])[0] - expected[0]).max() < 1e-6
    assert (rollout_from_seed(teacher, task, 3, seed=0).lengths > 0).all()


@pytest.mark.parametrize(
    ("name", "task", "message"),
    [
        ("td3", None, "name the task of the agent"),
        ("td3", MOUNTAINCAR, "2 inputs and 2 outputs, MountainCarContinuous-v0 has 2 and 1"),
        ("tanh", SIMPLEGOAL, "activation is .*Tanh.*, expected ReLU"),
        ("leaky", SIMPLEGOAL, "activation is .*LeakyReLU.*, expected ReLU"),
        ("sac", SIMPLEGOAL, "expected the tensors of a TD3 or DDPG actor"),
    ],
)
def test_a_zip_that_does_not_fit_is_one_clear_error(agents, name, task, message):
    with pytest.raises(ValueError, match=message):
        load_teacher(agents[1] / f"{name}.zip", task)


def rewritten(source, target, *, compression=zipfile.ZIP_DEFLATED, **parts):
    """A copy of a zip with some of its parts replaced (None: left out)."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", compression) as new:
        for name in old.namelist():
            content = parts.get(name.rpartition("/")[2].replace(".", "_"), old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def saved(content, **parts):
    """The bytes of `policy.pth` with `content`, as torch writes it, with some parts replaced."""
    import torch

    torch.save(content, buffer := io.BytesIO())
    return rewritten(buffer, io.BytesIO(), **parts).getvalue()


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def payloads(path):
    return [pickle.dumps(Payload(path)), saved({"actor.mu.0.weight": Payload(path)})]


@pytest.mark.parametrize("kind", [0, 1])
def test_a_payload_in_a_zip_is_not_run(agents, tmp_path, kind):
    mark = tmp_path / "ran"
    bad = rewritten(agents[1] / "small.zip", tmp_path / "bad.zip", policy_pth=payloads(mark)[kind])
    with pytest.raises(DamagedFile, match="bad.zip: not a zip of a Stable-Baselines3 agent"):
        load_teacher(bad, SIMPLEGOAL)
    assert not mark.exists()
    pickle.loads(pickle.dumps(Payload(mark))).close()
    assert mark.exists()  # the payload is live


@pytest.mark.parametrize(
    "parts",
    [{"data": None}, {"data": b"[]"}, {"policy_pth": b"zzz"}],
)
def test_a_zip_without_its_parts_is_refused(agents, tmp_path, parts):
    with pytest.raises(DamagedFile, match="x.zip"):
        load_teacher(rewritten(agents[1] / "small.zip", tmp_path / "x.zip", **parts), SIMPLEGOAL)


def test_a_policy_that_is_no_dictionary_of_tensors_is_refused(agents, tmp_path):
    import torch

    for content in (
        torch.zeros(3),
        [1, 2],
        {"actor.mu.0.weight": "text"},
        {"actor.mu.0.weight": torch.zeros(2, 2).int()},
    ):
        bad = rewritten(agents[1] / "small.zip", tmp_path / "x.zip", policy_pth=saved(content))
        with pytest.raises(ValueError):
            load_teacher(bad, SIMPLEGOAL)


def bombs():
    """Contents of a zip that take memory or time for ever where they are simply read, by name."""
    import torch

    tuples = b"\x80\x02})q\x00" + b"h\x00h\x00\x86q\x00" * 90 + b"K\x01s."  # a key of 2 ** 90 tuples
    shared, weight = torch.zeros(2**20), "actor.mu.0.weight"
    return {
        "expand": {"policy_pth": saved({weight: torch.zeros(1).expand(25_000, 25_000)})},
        "shared": {"policy_pth": saved({f"actor.{i}": shared for i in range(100)})},
        "lists": {"policy_pth": saved({}, data_pkl=b"\x80\x02" + b"]" * 2**24)},
        "tuples": {"policy_pth": saved({}, data_pkl=tuples)},
        "storage": {"policy_pth": saved({weight: torch.zeros(4)}, **{"0": bytes(2**20)})},
        "wide": {"data": b"[" + b"[]," * 2**24 + b"[]]"},
        "deep": {"data": b"[" * 2**18},
    }


def test_crafted_zips_are_refused_within_memory_and_time(agents, tmp_path):
    """In a process of its own: 1.5 GB for all of them, and a minute, of which the limits themselves leave much."""
    small = agents[1] / "small.zip"
    paths = [rewritten(small, tmp_path / f"{name}.zip", **parts) for name, parts in bombs().items()]
    paths.append(rewritten(small, tmp_path / "lzma.zip", compression=zipfile.ZIP_LZMA))
    with zipfile.ZipFile(tmp_path / "many.zip", "w") as many:
        for i in range(10_001):
            many.writestr(str(i), b"")
    os.mkfifo(tmp_path / "fifo.zip")
    (tmp_path / "folder.zip").mkdir()
    with open(tmp_path / "large.zip", "wb") as file:
        file.truncate(2**33)
    paths += [tmp_path / f"{name}.zip" for name in ("many", "fifo", "folder", "large")]
    code = (
        "import resource, sys, vsp\n"
        "for path in sys.argv[1:]:\n"
        f"    try: vsp.load_teacher(path, '{SIMPLEGOAL}')\n"
        "    except ValueError as error: print(type(error).__name__, str(error)[:500])\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    command = [sys.executable, "-c", code, *map(str, paths)]
    done = subprocess.run(command, cwd=atomic.ROOT, capture_output=True, text=True, timeout=60)
    *lines, peak = done.stdout.splitlines()
    assert [line.split(":")[0] for line in lines] == [f"DamagedFile {path}" for path in paths], done.stderr
    assert int(peak) < 1.5 * 2**30 / (1 if sys.platform == "darwin" else 1024)


def test_no_more_of_a_member_is_unpacked_than_is_allowed(agents, tmp_path, monkeypatch):
    bad, read = rewritten(agents[1] / "small.zip", tmp_path / "x.zip", data=bytes(2**26)), zipfile.ZipExtFile.read
    whole = pytest.fail  # no Exception, all of which `read_zip` catches
    monkeypatch.setattr(zipfile.ZipExtFile, "read", lambda file, n=None: read(file, n) if n else whole("of any size"))
    with pytest.raises(DamagedFile, match="bytes unpacked, expected at most"):
        load_teacher(bad, SIMPLEGOAL)


def test_loading_and_acting_needs_no_torch(agents):
    code = (
        f"import sys, vsp; vsp.load_teacher('{SIMPLEGOAL}').predict([[0.5, 0.5]])\n"
        f"vsp.load_teacher({str(agents[1] / 'small.zip')!r}, '{SIMPLEGOAL}')\n"
        "print({'torch', 'stable_baselines3'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=atomic.ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr


def test_an_altered_description_of_the_tensors_is_refused_or_harmless(agents, tmp_path):
    """With a right checksum, unlike a bit that flips: names, shapes and opcodes themselves are checked."""
    small, rng = agents[1] / "small.zip", np.random.default_rng(0)
    with zipfile.ZipFile(small) as archive:
        policy = io.BytesIO(archive.read("policy.pth"))
    with zipfile.ZipFile(policy) as inner:
        content = inner.read("archive/data.pkl")
    for _ in range(300):
        altered = bytearray(content[: rng.integers(len(content))] if rng.random() < 0.2 else content)
        for position in rng.integers(len(altered), size=rng.integers(1, 4)):
            altered[position] = rng.integers(256)
        new = rewritten(policy, io.BytesIO(), data_pkl=bytes(altered)).getvalue()
        bad = rewritten(small, tmp_path / "x.zip", compression=zipfile.ZIP_STORED, policy_pth=new)
        with contextlib.suppress(ValueError):
            assert np.isfinite(load_teacher(bad, SIMPLEGOAL).predict(np.ones((1, 2)))[0]).all()
