"""Files that are damaged, or made to harm: `make faults`."""

import base64
import hashlib
import io
import json
import pickle
import shutil
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support import SIMPLEGOAL, TINY, CurvedTeacher, Payload, flipped

import vsp
from studies import training
from studies.comparison.rows import Row, make_all
from vsp.paper import results, runs
from vsp.run import atomic
from vsp.run.listed import MANIFEST, list_folder, read_listed
from vsp.run.notebook import nbformat
from vsp.run.sealed import load_arrays, read_sealed
from vsp_course import build

FLIPS, TRUNCATIONS = 100, 50
PARSERS = ("json.loads", "numpy.load", "pandas.read_csv", "pickle.load", "pickle.loads", "safetensors.numpy.load",
           "torch.load")  # fmt: skip
RECIPE = training.Recipe(steps=40, batch_size=8, learning_starts=20, buffer_size=200)
EXPERIMENT = runs.Experiment(SIMPLEGOAL, TINY, CurvedTeacher(), 5)
WEIGHTS, CARD = f"teachers/{SIMPLEGOAL}.safetensors", f"teachers/{SIMPLEGOAL}.json"


# Damage


def copied(*names: str) -> Callable[[Path], Path]:
    """Puts committed files into a folder, the first of them to be damaged, and their manifest."""

    def make(folder: Path) -> Path:
        manifest = str(Path(names[0]).with_name(MANIFEST))
        paths = [shutil.copy(atomic.ROOT / "data" / name, folder) for name in (*names, manifest)]
        return Path(paths[0])

    return make


def run(folder: Path) -> Path:
    runs.make_runs(EXPERIMENT, [3], runs=folder)
    return EXPERIMENT.folder(folder) / "0003.run"


def row(folder: Path) -> Path:
    job = Row(SIMPLEGOAL, "teacher", 0, 0)
    make_all(folder, [job])
    return job.path(folder)


def checkpoint(folder: Path) -> Path:
    return training.train(SIMPLEGOAL, seed=0, cache=folder, recipe=RECIPE, report=lambda line: None)


def course(folder: Path) -> Path:
    build.build(folder)
    return folder / "build" / "course" / build.MADE


def of_study(path: Path) -> object:
    return results.read_results(path.stem, path.parent)


KINDS = {  # what makes such a file in a folder, and what reads it
    "run": (run, lambda path: runs.Distillation(EXPERIMENT, 3).run(path.parents[2])),
    "row of the comparison": (row, partial(load_arrays, kind="Row")),
    "policy": (copied("beyond/limit_LunarLanderContinuous-v3.policy"), vsp.VoronoiPolicy.load),
    "checkpoint of a training": (checkpoint, training.read_checkpoint),
    "weights": (copied(WEIGHTS, CARD), vsp.load_teacher),
    "card": (copied(CARD, WEIGHTS), lambda path: vsp.load_teacher(path.with_suffix(".safetensors"))),
    "results of a study": (copied("results/simpler.csv"), of_study),
    "what the course has made": (course, read_sealed),
}
TALLY = {}  # kind: refused, tried


def damage(content: bytes) -> list[bytes]:
    """Copies of `content`, each with one bit flipped or cut off."""
    rng, found = np.random.default_rng(len(content)), []
    for bit in rng.choice(8 * len(content), FLIPS, replace=False):
        found.append(flipped(content, bit))
    return found + [content[:n] for n in rng.choice(len(content), TRUNCATIONS, replace=False)]


def refused(read: Callable[[], object]) -> bool:
    try:
        read()
    except atomic.DamagedFile:
        return True
    return False


def parse(*given, **options):
    raise AssertionError("parsed")


@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_is_refused_before_it_is_parsed(name, tmp_path, monkeypatch):
    make, read = KINDS[name]
    path = make(tmp_path)
    content, found = path.read_bytes(), []
    read(path)
    for parser in PARSERS:
        monkeypatch.setattr(parser, parse)
    for damaged in damage(content):
        path.write_bytes(damaged)
        found.append(refused(partial(read, path)))
    TALLY[name] = sum(found), len(found)
    path.write_bytes(content)
    if read is not read_sealed:  # which parses nothing
        with pytest.raises(AssertionError, match="parsed"):
            read(path)
    assert all(found)


def test_all_damage_is_refused(record):
    assert TALLY.keys() == KINDS.keys(), "the tests above did not all run"
    good, tried = np.sum(list(TALLY.values()), axis=0)
    what = f"bit flips and truncations, {len(TALLY)} kinds of data file"
    record("input", what, good, f"of {tried}", at_least=tried, note="refused before they are parsed")


# Harm


def as_zip(**parts: bytes) -> bytes:
    """A zip of those members; `_pth` and the like end a name after a dot."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name.replace("__", "."), part)
    return content.getvalue()


def by(write: Callable, *given, **options) -> bytes:
    """What `write` writes into a file that comes first, last, or before its options."""
    content = io.BytesIO()
    write(content, *given, **options)
    return content.getvalue()


def notebook(parameters: str, **metadata) -> bytes:
    cell = nbformat.v4.new_code_cell(parameters, id="first", metadata={"tags": ["parameters"], **metadata})
    return nbformat.writes(nbformat.v4.new_notebook(cells=[cell], metadata=metadata)).encode()


SUFFIXES = ("run", "pt", "safetensors", "json", "csv", "zip", "ipynb", "npz")


def payloads(mark: Path, agent: bytes) -> dict[str, bytes]:
    """Files by name that write `mark` if anybody unpickles or constructs what they hold; `agent` is a sound zip."""
    import torch

    raw, tag = pickle.dumps(Payload(mark)), f'!!python/object/apply:builtins.open ["{mark}", "w"]'
    text = base64.b64encode(raw).decode()
    saved = by(lambda file: torch.save({"actor.mu.0.weight": Payload(mark)}, file))
    objects = np.array([Payload(mark)], dtype=object)
    with zipfile.ZipFile(io.BytesIO(agent)) as archive:
        parts = {name.replace(".", "__"): archive.read(name) for name in archive.namelist()}
    about = {**json.loads(parts["data"]), "policy_class": {":type:": "x", ":serialized:": text}}
    card = {"task": SIMPLEGOAL, "sha256": hashlib.sha256(raw).hexdigest(), ":serialized:": text, "yaml": tag}
    found = {f"raw.{suffix}": raw for suffix in SUFFIXES}
    found |= {f"torch.{suffix}": saved for suffix in ("pt", "zip", "run")}
    found |= {
        "data.zip": as_zip(**parts | {"data": json.dumps(about).encode()}),
        "policy.zip": as_zip(**parts | {"policy__pth": raw}),
        "variables.zip": as_zip(**parts | {"pytorch_variables__pth": saved}),
        "optimizer.zip": as_zip(**parts | {"actor__optimizer__pth": raw, "critic__optimizer__pth": saved}),
        "objects.npy": by(np.save, objects, allow_pickle=True),
        "objects.npz": by(lambda file: np.savez(file, codewords=objects)),
        "tag.yaml": tag.encode(),
        "table.csv": f'key,settings,code,failing\n"{tag}",{text},{text},1\n'.encode(),
        "card.json": json.dumps(card).encode(),
        "card.safetensors": raw,
        "parameters.ipynb": notebook(f"out = open({str(mark)!r}, 'w')"),
        "expression.ipynb": notebook(f"out = ''\n[open({str(mark)!r}, 'w')]"),
        "kernel.ipynb": notebook("out = ''", kernelspec={"name": tag, "display_name": tag, "argv": [tag]}),
    }
    about = {"about": json.dumps({"kind": "Run", "settings": {"task": tag}, "seed": text})}
    from safetensors.numpy import save

    sealed = {"pickle": raw, "torch": saved, "tensors": save({"codewords": np.zeros(1)}, metadata=about)}
    return found | {
        f"sealed_{name}.{suffix}": hashlib.sha256(content).hexdigest().encode() + b"\n" + content
        for name, content in sealed.items()
        for suffix in ("run", "pt")
    }


LOADERS = {
    "teacher": vsp.load_teacher,
    "teacher of a task": lambda path: vsp.load_teacher(path, SIMPLEGOAL),
    "agent": vsp.agent,
    "policy": vsp.VoronoiPolicy.load,
    "run": partial(load_arrays, kind="Run"),
    "row": partial(load_arrays, kind="Row"),
    "checkpoint": training.read_checkpoint,
    "sealed": read_sealed,
    "listed": read_listed,
    "study": lambda path: of_study(path.with_suffix(".csv")),
}
REFUSALS = (ValueError, FileNotFoundError)


@pytest.fixture
def agent(tmp_path):
    """The zip that Stable-Baselines3 saves."""
    import gymnasium
    from stable_baselines3 import TD3

    made = TD3("MlpPolicy", gymnasium.make(SIMPLEGOAL), buffer_size=10, policy_kwargs={"net_arch": [8]}, device="cpu")
    made.save(tmp_path / "agent.zip")
    return (tmp_path / "agent.zip").read_bytes()


@pytest.mark.parametrize("listed", [True, False])
def test_no_payload_runs(agent, tmp_path, listed, record):
    mark, folder = tmp_path / "ran", tmp_path / "files"
    folder.mkdir()
    made, harmless = payloads(mark, agent), 0
    for name, content in made.items():
        (folder / name).write_bytes(content)
    if listed:
        list_folder(folder)  # somebody accepted them all
    for name in made:
        for loader in LOADERS.values():
            try:
                loader(folder / name)
            except REFUSALS as error:
                assert str(error)
        harmless += not mark.exists()
        mark.unlink(missing_ok=True)
    if listed:
        what = "files with pickles, YAML tags or code, through every loader"
        record("input", what, harmless, f"of {len(made)}", at_least=len(made), note="no code was run")
    assert harmless == len(made) >= 15
