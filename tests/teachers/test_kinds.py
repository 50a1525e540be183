"""Every kind of agent that the libraries save acts here as there, and what is another kind is refused by name."""

import io
import os
import pickle
import pydoc
import re
import shutil
import zipfile
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from support import SIMPLEGOAL
from zips import CAR, Car, bomb, in_float64, made, retold, rewritten, saved

from vsp import load_teacher, rollout_from_seed
from vsp.teachers import agent_zip
from vsp.teachers.inert import array, described

SMALL, SDE = {"net_arch": [12, 8]}, {"use_sde": True}
ACTIVATIONS = ("Tanh", "ReLU", "ELU", "LeakyReLU", "GELU", "SiLU")
KINDS = [(name, {}, SMALL) for name in ("TD3", "DDPG", "SAC", "TQC", "CrossQ", "PPO", "A2C", "TRPO", "ARS")]
KINDS += [(name, SDE, SMALL) for name in ("SAC", "TQC", "CrossQ", "PPO", "A2C", "TRPO")]
KINDS += [(name, {}, {"net_arch": []}) for name in ("TD3", "SAC", "CrossQ", "PPO", "ARS")]
KINDS += [(name, {}, SMALL | {"activation_fn": act}) for name in ("TD3", "A2C") for act in ACTIVATIONS]
KINDS += [
    ("PPO", SDE, SMALL | {"squash_output": True}), ("PPO", {}, {"net_arch": {"pi": [], "vf": []}}),
    ("PPO", {}, {"net_arch": {"pi": [5, 4, 3], "vf": [2]}, "share_features_extractor": False}),
    ("SAC", SDE, {"net_arch": [64, 3]}), ("SAC", SDE, {"net_arch": [2]}), ("SAC", SDE, SMALL | {"clip_mean": 0.5}),
    ("SAC", SDE, SMALL | {"clip_mean": 0.0}), ("SAC", {}, SMALL | SDE), ("CrossQ", {}, SMALL | {"batch_norm": False}),
    ("CrossQ", SDE, SMALL | {"batch_norm_eps": 0.5}), ("LinearPolicy", {}, {}),
    ("LinearPolicy", {}, {"with_bias": True, "squash_output": True}),
    ("ARS", {}, SMALL | {"with_bias": False, "squash_output": np.bool_(False)}),
]  # fmt: skip


def acts_as(model, teacher, most=1e-5):
    """Assert that `teacher` acts as the network of `model` in float64 and as the library does, all but rounding."""
    low, high = teacher.task.low, teacher.task.high
    obs = np.random.default_rng(0).uniform(low, high, (10_000, len(low))).astype(np.float32)
    actions, seen = teacher.predict(obs)[0], teacher.inputs(obs)
    assert np.ptp(actions, axis=0).max() > 1e-5 and actions.dtype == np.float32
    assert np.allclose(teacher.predict(obs[0])[0], actions[0], atol=1e-5) and teacher.predict(obs[0])[1] is None
    assert np.abs(actions - in_float64(model, seen)).max() < most
    assert np.abs(actions - model.predict(seen, deterministic=True)[0]).max() < 1e-4


@pytest.mark.parametrize(("name", "about", "settings"), KINDS)
def test_a_zip_of_any_kind_acts_as_its_library_does(name, about, settings, tmp_path):
    algorithm, policy = ("ARS", name) if name == "LinearPolicy" else (name, "MlpPolicy")
    model = made(algorithm, Car(), policy, about=about, **settings)
    model.save(tmp_path / "agent.zip")
    acts_as(model, load_teacher(tmp_path / "agent.zip", CAR))


@pytest.mark.parametrize("protocol", [4, 5])
def test_arrays_are_read_in_either_order_of_memory(protocol):
    values = np.arange(6.0).reshape(2, 3)
    for given in (values, np.asfortranarray(values)):
        assert np.array_equal(array(described(pickle.dumps(given, protocol)), "it"), values)


# What says one thing more

OWN = {
    "policy_class": "stable_baselines3.td3.policies.TD3Policy", "activation_fn": "torch.nn.Tanh",
    "features_extractor_class": "stable_baselines3.common.torch_layers.FlattenExtractor",
}  # fmt: skip


@pytest.mark.parametrize("module", [__name__, "__main__"])  # by its name; with its code
@pytest.mark.parametrize("what", OWN)
def test_an_own_class_is_refused_by_name(what, module, tmp_path, monkeypatch):
    parent = pydoc.locate(OWN[what])
    doubled = {"__module__": module, "forward": lambda self, *given: 2 * parent.forward(self, *given)}
    monkeypatch.setitem(globals(), "Mine", mine := type("Mine", (parent,), doubled))
    policy, settings = (mine, {}) if what == "policy_class" else ("MlpPolicy", {what: mine})
    made("TD3", policy=policy, **SMALL, **settings).save(tmp_path / "own.zip")
    with pytest.raises(ValueError, match=f"own.zip: its .*{what.split('_')[0]}.*{module}.*If its own library loads it"):
        load_teacher(tmp_path / "own.zip", SIMPLEGOAL)


def space(name, *limits):
    """An observation or action space with these limits, or a space of another class."""
    box = gymnasium.spaces.Box(*limits[:2], limits[2:]) if limits else gymnasium.spaces.Discrete(2)
    return {f"{name}_space": pickle.dumps(box)}


def kwargs(**settings):
    return {"policy_kwargs": settings}


def nested(name):
    return {"policy_kwargs": bomb(lambda tuples: {name: tuples})}


def activation(name):
    return {"policy_kwargs": f"\x80\x04}}\x8c\x0dactivation_fnctorch.nn.modules.{name}\ns.".encode("latin1")}


SAYS = {
    "layer_norm": kwargs(layer_norm=True), "squash_output is no number": kwargs(squash_output=[]),
    "clip_mean is no number": kwargs(use_sde=True, clip_mean="x"), "clip_mean is 0.0": kwargs(use_sde=False),
    "hidden layers of .12, 8. units, net_arch": kwargs(net_arch={"pi": [9]}), "extra = a tuple": nested("extra"),
    "activation is a tuple": nested("activation_fn"), "net_arch is a tuple": nested("net_arch"),
    "policy_kwargs are a tuple": {"policy_kwargs": bomb()}, "policy_kwargs are 3": {"policy_kwargs": 3},
    "activation.PReLU, expected one of ReLU, Tanh": activation("activation\nPReLU"),
    "activation.Softplus, expected": activation("activation\nSoftplus"), "n.Tanh, e": activation("normalization\nTanh"),
    "policy class is one that": {"policy_class": pickle.dumps("TD3Policy")}, "not enough": {"policy_class": b"\x80"},
    "RecurrentActor.* keeps a memory between steps: train one without$": {
        "policy_class": b"\x80\x04csb3_contrib.common.recurrent.policies\nRecurrentActorCriticPolicy\n."
    },
    "action_space is missing": {"action_space": None}, "its action_space is .*Discrete, expected": space("action"),
    r"low of its action_space is .0.0, 0.0., SimpleGoal-v0 has .-1": space("action", 0, 1, 2),
    "high of its action_space": space("action", -1, 1.01, 2), "action_space is .-inf": space("action", -np.inf, 1, 2),
    "low of its observ": space("observation", -1, 1, 2), "observation_space has 3": space("observation", 0, 1, 3),
    "limit of its action_space is no": {"action_space": b"\x80\x04cgym.spaces.box\nBox\n)\x81}\x8c\x03low\x8c\x01ysb."},
}  # fmt: skip


@pytest.mark.parametrize("message", SAYS)
def test_a_setting_that_is_not_known_is_refused_by_name(message, tmp_path):
    made("SAC", about=SDE, **SMALL).save(tmp_path / "sac.zip")
    with pytest.raises(ValueError, match=rf"x.zip: .*{message}"):
        load_teacher(retold(tmp_path / "sac.zip", tmp_path / "x.zip", **SAYS[message]), SIMPLEGOAL)


MORE = {  # tensors of that shape
    "actor.mu.1.weight": ("TD3", (8, 8)), "actor.scale": ("TD3", ()), "features_extractor.0.weight": ("TD3", (2, 2)),
    "actor.mu.2.gain": ("TD3", (8,)), "actor.mu.6.weight": ("TD3", (2, 2)), "actor.mu.00.weight": ("TD3", (2, 2)),
    "actor.mu.0.weight": ("SAC", (2, 2)), "actor.latent_pi.2.weight_g": ("SAC", (8, 1)),
    "action_net.0.weight": ("PPO", (2, 2)), "mlp_extractor.policy_net.1.weight": ("PPO", (12,)),
    "pi_features_extractor.0.weight": ("PPO", (2, 2)), "log_std_x": ("PPO", (2,)), "action_net.1.weight": ("ARS", (2,)),
}  # fmt: skip


@pytest.mark.parametrize("name", MORE)
def test_a_tensor_more_is_refused_by_name(name, tmp_path):
    import torch

    algorithm, shape = MORE[name]
    both = {name: torch.ones(shape), name.replace("weight", "bias"): torch.ones(shape[:1])}
    made(algorithm, **SMALL).save(tmp_path / "sound.zip")
    with pytest.raises(ValueError, match=f"x.zip: .*({name.rpartition('.')[0] or name}|net_arch|clip_mean)"):
        load_teacher(retold(tmp_path / "sound.zip", tmp_path / "x.zip", lambda had: had | both), SIMPLEGOAL)


@pytest.mark.parametrize("old", [False, True], ids=["zip", "old"])
def test_a_storage_must_have_the_length_that_is_described(old, tmp_path):
    """An array over an empty storage would read memory beyond it."""
    import torch

    made("SAC", **SMALL).save(tmp_path / "sound.zip")
    retold(tmp_path / "sound.zip", tmp_path / "sac.zip", old=old)
    with zipfile.ZipFile(tmp_path / "sac.zip") as archive:
        policy = archive.read("policy.pth")
    tensors = torch.load(io.BytesIO(policy))
    size = sum(4 * tensor.numel() for tensor in tensors.values())
    cut = policy[: 4 - size] if old else saved(tensors, **{"0": b""})
    rewritten(tmp_path / "sac.zip", tmp_path / "cut.zip", policy_pth=cut)
    with pytest.raises(ValueError, match=r"cut.zip: .*a tensor ends at element \d+, of \d+ in \d+ bytes"):
        load_teacher(tmp_path / "cut.zip", SIMPLEGOAL)


@pytest.mark.parametrize("stride", [(9, 1), (1, 99)])
def test_a_tensor_must_lie_in_its_storage(stride):
    view = agent_zip._View(np.dtype("<f4"), "0", 8, 0, (2, 4), stride)
    with pytest.raises(ValueError, match="a tensor ends at element"):
        agent_zip._tensor(bytes(32), view)
    inside = agent_zip._tensor(np.arange(8, dtype="<f4").tobytes(), view._replace(stride=(4, 1)))
    assert inside.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]]


@pytest.mark.parametrize("units", [[8, 8, 8], [8]])
def test_without_net_arch_a_network_has_the_layers_of_its_class(units, tmp_path):
    made("SAC", net_arch=units).save(tmp_path / "told.zip")
    load_teacher(tmp_path / "told.zip", SIMPLEGOAL)
    untold = retold(tmp_path / "told.zip", tmp_path / "x.zip", policy_kwargs={})
    with pytest.raises(ValueError, match="x.zip: its tensors make hidden layers of .8.* units, without net_arch"):
        load_teacher(untold, SIMPLEGOAL)


# Older zips


def shared(tensors):
    """Those of [12, dict(pi=[8], vf=[8])], where the first layer of the actor is the critic's as well."""
    new = [name.replace("policy_net.0", "shared_net.0").replace("policy_net.2", "policy_net.0") for name in tensors]
    return type(tensors)(zip(new, tensors.values()))


OLD = [(name, {"old": True}) for name in ("TD3", "SAC", "PPO", "CrossQ")]  # in the format of torch before 1.6
OLD += [("PPO", {"tensors": shared, **kwargs(net_arch=[12, {"pi": [8], "vf": [8]}])})]
OLD += [("TD3", space("observation", -np.inf, np.inf, 2)), ("SAC", {"_last_original_obs": [[0.5, 0.5]]})]


@pytest.mark.parametrize(("name", "change"), OLD)
def test_a_zip_of_older_versions_or_with_more_of_its_training_is_the_same_agent(name, change, tmp_path):
    made(name, **SMALL).save(tmp_path / "new.zip")
    old = retold(tmp_path / "new.zip", tmp_path / "old.zip", **change)
    assert load_teacher(old, SIMPLEGOAL).digest == load_teacher(tmp_path / "new.zip", SIMPLEGOAL).digest


# The RL Zoo's, in the folder that VSP_AGENTS names: a zip for each algorithm and task

AGENTS = Path(os.environ.get("VSP_AGENTS", "nowhere"))
ZIPS = sorted(AGENTS.glob("*.zip"))


def as_library(path, name, task):
    """The library's own agent, made anew with the tensors of an old zip that it may not load."""
    import torch

    saved = agent_zip.read_zip(path)
    told = saved.setting("policy_kwargs")
    options = {"use_sde": saved.settings["use_sde"]} if name.upper() not in ("DDPG", "ARS") else {}
    shape = {key: told[key] for key in ("net_arch", "n_critics") if key in told}
    model = made(name.upper(), task, about=options, **shape)
    tensors = {key: torch.as_tensor(value) for key, value in saved.tensors.items()}
    assert not model.policy.load_state_dict(tensors, strict=False).unexpected_keys
    return model


@pytest.mark.parametrize("path", ZIPS or [pytest.param(AGENTS, marks=pytest.mark.skip("VSP_AGENTS is not set"))])
def test_an_agent_of_the_zoo_acts_and_earns_as_there(path, tmp_path):
    (name, _, task), statistics = path.stem.partition("-"), path.with_name(f"{path.stem}.vecnormalize.pkl")
    if statistics.exists():
        for zip_file in (path, shutil.copy(path, tmp_path)):  # away from its neighbours, it tells by itself
            with pytest.raises(ValueError, match="normalize="):
                load_teacher(zip_file, task)
    teacher = load_teacher(path, task, normalize=statistics if statistics.exists() else None)
    acts_as(as_library(path, name, task), teacher, most=2e-5)
    rows = (AGENTS / "README.md").read_text().replace("(", "| ").partition(f"| {task} ")[2]
    mean, deviation = map(float, re.search(rf"\| {name.upper()} .*?\| (-?[\d.]+) ± ([\d.]+)", rows).groups())
    returns = rollout_from_seed(teacher, task, 300, seed=0).returns
    assert abs(returns.mean() - mean) < 3 * np.sqrt(returns.var(ddof=1) / 300 + deviation**2 / 150)  # 150: the zoo
