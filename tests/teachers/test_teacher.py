import os
import pickle
import sys
import zipfile

import numpy as np
import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, Payload, network_teacher, python
from test_normalization import written
from zips import bomb, rewritten, saved

from vsp.run import listed
from vsp.run.atomic import DamagedFile
from vsp.teachers import SHIPPED, Teacher, agent_zip, load_teacher, normalization


def layer(inputs, outputs, weight=0.0):
    """The tensors of an actor without hidden layers."""
    return {"mu.0.weight": np.full((outputs, inputs), weight, "f4"), "mu.0.bias": np.zeros(outputs, "f4")}


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (layer(3, 2), "3 inputs and 2 outputs, SimpleGoal-v0 has 2 and 2"),
        ({}, "expected a layer at the end"),
        ({"mu.0.weight": layer(2, 2)["mu.0.weight"]}, "mu.0 has the tensors weight, expected a weight and a bias"),
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
    actor, moments = network_teacher(SIMPLEGOAL).actor, (np.zeros(2), np.ones(2))
    norms = [normalization.Normalization(*moments, *n) for n in ((1e-8, 10.0), (1e-3, 10.0), (1e-8, 5.0))]
    others = [Teacher(actor._replace(clip_mean=2.0), SIMPLEGOAL)]
    others += [Teacher(actor, SIMPLEGOAL, normalization=one) for one in norms]
    assert len({digests[0], *(other.digest for other in others)}) == 5


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


def test_the_task_of_a_zip_is_asked_for(small):
    with pytest.raises(ValueError, match="name the task of the agent"):
        load_teacher(small)


def test_loading_and_acting_needs_no_torch(small):
    code = (
        f"import sys, vsp; vsp.load_teacher('{SIMPLEGOAL}').predict([[0.5, 0.5]])\n"
        f"vsp.load_teacher({str(small)!r}, '{SIMPLEGOAL}')\n"
        "print({'torch', 'stable_baselines3'} & set(sys.modules))"
    )
    assert python(code).strip() == "set()"


# Files that are made to harm

WEIGHT = "actor.mu.weight"


def zips(mark):
    """Contents of a zip that take memory or time for ever where they are read, write `mark`, or make no agent."""
    import torch

    tuples = b"\x80\x02})q\x00" + b"h\x00h\x00\x86q\x00" * 90 + b"K\x01s."  # a key of 2 ** 90 tuples
    shared, payload = torch.zeros(2**20), Payload(mark)
    policies = [
        saved({WEIGHT: torch.zeros(1).expand(25_000, 25_000)}), saved({f"actor.{i}": shared for i in range(100)}),
        saved({}, data_pkl=b"\x80\x02" + b"]" * 2**24), saved({}, data_pkl=tuples), saved(torch.zeros(3)),
        saved([1, 2]), saved({WEIGHT: torch.zeros(4)}, **{"0": bytes(2**20)}), pickle.dumps(payload), b"zzz",
        saved({WEIGHT: payload}), saved({WEIGHT: "text"}), saved({WEIGHT: torch.zeros(2, 2).int()}),
    ]  # fmt: skip
    wide = b"[" + b"[]," * 2**24 + b"[]]"
    return [{"policy_pth": x} for x in policies] + [{"data": x} for x in (wide, b"[" * 2**18, b"[]", None)]


def statistics(mark, sound):
    """Contents of a file of statistics of that sort; `sound` is a good one."""
    state = b"\x80\x04cstable_baselines3.common.vec_env.vec_normalize\nVecNormalize\n)\x81}\x8c\x07obs_rms"
    nested = bomb(lambda tuples: {"mean": tuples, "var": tuples})[11:-1]  # without its beginning and end
    system, claim = b"cposix\nsystem\n(Vtouch " + bytes(mark) + b"\ntR.", b"\x80\x04B\xff\xff\xff\x3fxxx"
    slow = b"\x80\x04N" + b"\x94" * 2**20 + b"."  # remembers the same value a million times
    found = [pickle.dumps(Payload(mark)), system, bomb(), sound[:-40], b"]" * 2**24, claim]
    return [*found, state + nested + b"sb.", slow]


def test_crafted_files_are_refused_within_memory_and_time(small, tmp_path):
    """In a process of its own: 1.5 GB for all of them, and a minute, of which the limits themselves leave much."""
    mark, sound = tmp_path / "ran", tmp_path / "sound.pkl"
    written(sound)
    rewritten(small, tmp_path / "lzma.zip", compression=zipfile.ZIP_LZMA)
    for i, parts in enumerate(zips(mark)):
        rewritten(small, tmp_path / f"{i}.zip", **parts)
    with zipfile.ZipFile(tmp_path / "many.zip", "w") as many:
        for i in range(10_001):
            many.writestr(str(i), b"")
    for suffix in (".zip", ".pkl"):
        os.mkfifo(tmp_path / f"fifo{suffix}")
        (tmp_path / f"folder{suffix}").mkdir()
        with open(tmp_path / f"large{suffix}", "wb") as file:
            file.truncate(2**33)
    for i, content in enumerate(statistics(mark, sound.read_bytes())):
        (tmp_path / f"{i}.pkl").write_bytes(content)
    paths = sorted(path for path in tmp_path.iterdir() if path != sound)
    code = (
        "import resource, sys, vsp\n"
        "for path in sys.argv[2:]:\n"
        f"    given = (path, '{SIMPLEGOAL}') if path.endswith('zip') else (sys.argv[1], '{SIMPLEGOAL}')\n"
        "    try: vsp.load_teacher(*given, normalize=path.endswith('pkl') and path)\n"
        "    except ValueError as error: print(type(error).__name__, str(error)[:500])\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    *lines, peak = python(code, small, *paths, timeout=60).splitlines()
    assert [line.split(":")[0] for line in lines] == [f"DamagedFile {path}" for path in paths]
    assert int(peak) < 1.5 * 2**30 / (1 if sys.platform == "darwin" else 1024) and not mark.exists()


def test_no_more_of_a_member_is_unpacked_than_is_allowed(small, tmp_path, monkeypatch):
    lies = rewritten(small, tmp_path / "lies.zip")
    with zipfile.ZipFile(lies, "a") as archive:
        archive.getinfo("data").file_size, archive._didModify = 2**31, True
    bad, read = rewritten(small, tmp_path / "x.zip", data=bytes(2**26)), zipfile.ZipExtFile.read
    whole = pytest.fail  # no Exception, all of which `read_zip` catches
    monkeypatch.setattr(zipfile.ZipExtFile, "read", lambda file, n=None: read(file, n) if n else whole("of any size"))
    with pytest.raises(DamagedFile, match="bytes unpacked, expected at most"):
        load_teacher(bad, SIMPLEGOAL)
    with pytest.raises(DamagedFile, match="data is 2147483648 bytes unpacked, expected at most"):
        load_teacher(lies, SIMPLEGOAL)


@pytest.mark.parametrize("module", [agent_zip, normalization])
def test_an_altered_description_is_refused_or_harmless(module, small, tmp_path, monkeypatch):
    """Of tensors, classes, spaces and statistics, with a right checksum, unlike a bit that flips."""
    rng, described = np.random.default_rng(0), module.described
    written(tmp_path / "s.pkl")

    def spoilt(content):
        altered = bytearray(content[: rng.integers(1, len(content))] if rng.random() < 0.1 else content)
        for position in rng.integers(len(altered), size=rng.integers(3)):
            altered[position] = rng.integers(256)
        return described(bytes(altered))

    monkeypatch.setattr(module, "described", spoilt)
    for _ in range(500):
        try:
            teacher = load_teacher(small, SIMPLEGOAL, normalize=tmp_path / "s.pkl")
            assert np.isfinite(teacher.predict(np.ones((1, 2)))[0]).all()
        except ValueError as error:
            assert str(small) in str(error) or str(tmp_path) in str(error)
