"""Agents that were trained on normalised observations: with their statistics they act as there, without they do not."""

import shutil

import gymnasium
import numpy as np
import pytest
from support import SIMPLEGOAL
from zips import made

import vsp

OBS = np.random.default_rng(0).random((10_000, 2)).astype(np.float32)
RMS = {"count": 9.0, "mean": np.array([0.25, 0.5]), "var": np.array([0.25, 0.0])}


def normalised(**options):
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    return VecNormalize(DummyVecEnv([lambda: gymnasium.make(SIMPLEGOAL)]), **options)


def written(path, **changes):
    """The file that the library saves, with some attributes (and those of `obs_rms`) set anew."""
    env = normalised()
    vars(env.obs_rms).update(RMS | {name: changes.pop(name) for name in ("mean", "var") if name in changes})
    vars(env).update(changes)
    env.save(path)
    return env


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A folder with an on-policy agent, saved, and its statistics; and the agent itself."""
    folder, env = tmp_path_factory.mktemp("trained"), normalised(clip_obs=1.5)
    model = made("PPO", env, about={"n_steps": 8, "batch_size": 4}, net_arch=[8]).learn(16)
    model.save(folder / "ppo.zip")
    env.save(folder / "statistics.pkl")
    return folder, model, env


def test_an_agent_with_its_statistics_acts_as_the_library_does_and_asks_for_them(trained):
    folder, model, env = trained
    path, given = folder / "ppo.zip", {"normalize": folder / "statistics.pkl"}
    alone, unaware = type(model).load(path), vsp.load_teacher(path, SIMPLEGOAL, normalize=False)
    expected = model.predict(env.normalize_obs(OBS), deterministic=True)[0]
    by_object = (vsp.agent(source, SIMPLEGOAL, normalize=env) for source in (path, alone))
    for agent in (vsp.load_teacher(path, SIMPLEGOAL, **given), vsp.agent(model), vsp.agent(alone, **given), *by_object):
        assert np.abs(agent.predict(OBS)[0] - expected).max() < 1e-4
    for agent in (unaware, vsp.agent(alone, normalize=False), vsp.agent(model, normalize=False)):
        assert np.abs(agent.predict(OBS)[0] - expected).max() > 0.05
    for source, normalize in ((path, None), (path, True), (alone, None), (alone, True)):
        with pytest.raises(ValueError, match="normalised observations.*normalize="):
            vsp.agent(source, SIMPLEGOAL, normalize=normalize)
    rewards = made("PPO", normalised(norm_obs=False), about={"n_steps": 8, "batch_size": 4}).learn(8)
    assert np.array_equal(vsp.agent(rewards).predict(OBS)[0], rewards.predict(OBS, deterministic=True)[0])


@pytest.mark.parametrize(
    "changes",
    [{}, {"clip_obs": 0.3}, {"epsilon": 0.5}, {"var": np.zeros(2)}, {"norm_obs": False}, {"norm_obs": np.bool_(False)}],
)
def test_statistics_are_used_as_the_library_does(changes, small, tmp_path):
    env = written(tmp_path / "s.pkl", **changes)
    teacher, raw = (vsp.load_teacher(small, SIMPLEGOAL, normalize=n) for n in (str(tmp_path / "s.pkl"), False))
    assert np.abs(teacher.predict(OBS)[0] - raw.predict(env.normalize_obs(OBS))[0]).max() < 1e-6
    assert (teacher.normalization is not None) == env.norm_obs == (teacher.digest != raw.digest)
    assert teacher.card["recipe"]["steps"] == raw.card["recipe"]["steps"] >= 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mean": np.zeros(3), "var": np.ones(3)}, r"mean have shape \(3,\), expected \(2,\)"),
        ({"var": np.array([1.0, -1.0])}, "variance .*-1.0.*expected positive ones"),
        ({"var": np.array([1.0, np.nan])}, "var hold nan"), ({"mean": np.array([np.inf, 1.0])}, "mean hold inf"),
        ({"var": np.zeros(2), "epsilon": 0.0}, "expected pos"), ({"epsilon": -1.0}, "expected positive ones"),
        ({"clip_obs": 0.0}, "expected positive ones"), ({"clip_obs": np.nan}, "expected positive ones"),
        ({"obs_rms": RMS}, "of a dictionary"), ({"mean": np.array(["a", "b"])}, "not the statistics"),
    ],
)  # fmt: skip
def test_statistics_that_do_not_fit_are_refused(changes, message, small, tmp_path):
    written(tmp_path / "s.pkl", **changes)
    with pytest.raises(ValueError, match=rf"s.pkl: .*{message}"):
        vsp.load_teacher(small, SIMPLEGOAL, normalize=tmp_path / "s.pkl")


# Signs

SIGNS = {
    "x_5_steps.vecnormalize.pkl": "", "x_5_steps/vecnormalize.pkl": "", "vecnormalize.pkl": "", "vec_normalize.pkl": "",
    "x_vecnormalize_5_steps.pkl": "", "config.yml": "normalize: {norm_reward: true}",
    "x_5_steps.config.yml": "normalize: true",
    "x_5_steps/config.yml": "!!python/object/apply:collections.OrderedDict\n- - - normalize\n    - dict(norm_obs=True)",
}  # fmt: skip
NO_SIGNS = [f"n_envs: 4\nnormalize: {value}" for value in (
    "false", "False", "", "~", "'no'", "dict(norm_obs=False, norm_reward=True)", "{norm_obs: false}",
    '"{\'norm_obs\': False}"', f'"{" " * 500_000}x{" " * 100_000}norm_obs=False"')]  # fmt: skip
NO_SIGNS += ["&a [*a, *a]", "normalise: true", "a: {normalise: true}"]
UNREADABLE = [b"a: [", b": : :", b"[" * 9999, b"a:\n\tnormalize: true", b"a: \xfc\nnormalize: true"]
UNREADABLE.append(b"#" * 2**20 + b"\nnormalize: true")
HIDDEN = ["a: 1\n---\nnormalize: true", "hyperparams: {normalize: true}", "normalize: false\nnormalize: true",
          "Normalize: true", "a: [[b, {normalize: dict(norm_obs=True)}]]"]  # fmt: skip


@pytest.mark.usefixtures("no_collection")
def test_settings_nearby_may_say_so_or_not(small, tmp_path):
    path = shutil.copy(small, tmp_path / "x.zip")
    for text in NO_SIGNS:
        (tmp_path / "config.yml").write_text(text)
        vsp.load_teacher(path, SIMPLEGOAL)
    for content in [*UNREADABLE, *map(str.encode, HIDDEN)]:
        (tmp_path / "config.yml").write_bytes(content)
        with pytest.raises(ValueError, match="x.zip: .*config.yml (may say so, but cannot be read|says so)"):
            vsp.load_teacher(path, SIMPLEGOAL)


LAYOUTS = {  # of RL Zoo, and names that people give
    "sac/Pendulum-v1_1/best_model.zip": "sac/Pendulum-v1_1/Pendulum-v1/vecnormalize.pkl",
    "sac/Walker2d-v3_12/Walker2d-v3.zip": "sac/Walker2d-v3_12/Walker2d-v3/vecnormalize.pkl",
    "best_model.zip": "best_vecnorm.pkl", "model.zip": "vecnorm.pkl", "a/model.zip": "a/VecNormalize.pkl",
    "run_best.zip": "run_vecnormalize.pkl", "final.zip": "my_vec_normalize.pickle",
    "Pendulum-v1_3/best_model.zip": "Pendulum-v1_3/Pendulum-v1/config.yml",
}  # fmt: skip


@pytest.mark.parametrize(("zip_file", "name"), [*(("x_5_steps.zip", name) for name in SIGNS), *LAYOUTS.items()])
def test_statistics_and_settings_are_found_wherever_people_keep_them(zip_file, name, small, tmp_path):
    for each in (zip_file, name):
        (tmp_path / each).parent.mkdir(parents=True, exist_ok=True)
    path, said = shutil.copy(small, tmp_path / zip_file), "says so" if name.endswith(".yml") else "lies beside it"
    (tmp_path / name).write_text(SIGNS.get(name, "normalize: true"))
    with pytest.raises(ValueError, match=f"{zip_file}: .*{name} {said}.*Pass their statistics, normalize="):
        vsp.load_teacher(path, SIMPLEGOAL)
    vsp.load_teacher(path, SIMPLEGOAL, normalize=False)


def test_statistics_named_after_another_agent_are_that_agents(small, tmp_path):
    for name in ("sac", "ppo", "ppo_best"):
        shutil.copy(small, tmp_path / f"{name}.zip")
    written(tmp_path / "ppo_vecnormalize.pkl")
    vsp.load_teacher(tmp_path / "sac.zip", SIMPLEGOAL)
    for name in ("ppo", "ppo_best"):  # the second may be a copy of the first
        with pytest.raises(ValueError, match="ppo_vecnormalize.pkl lies beside it"):
            vsp.load_teacher(tmp_path / f"{name}.zip", SIMPLEGOAL)


def test_another_version_of_the_environment_is_named(small, tmp_path):
    path = shutil.copy(small, tmp_path / "x.zip")
    (tmp_path / "args.yml").write_text("!!python/object/apply:collections.OrderedDict\n- - - env\n    - SimpleGoal-v9")
    said = "x.zip was trained on SimpleGoal-v9, and acts on SimpleGoal-v0: they may differ"
    with pytest.warns(UserWarning, match=said):
        vsp.load_teacher(path, SIMPLEGOAL)
    (tmp_path / "args.yml").write_text("env: SimpleGoal-v0")
    vsp.load_teacher(path, SIMPLEGOAL)


# What a user gives


def normalising(obs):
    return np.clip(np.tanh(obs[:, ::-1]), -1, 1)


def test_statistics_may_be_two_arrays(trained):
    folder, model, env = trained
    alone = type(model).load(folder / "ppo.zip")
    both = env.obs_rms.mean, env.obs_rms.var
    plain = np.clip((OBS - both[0]) / np.sqrt(both[1] + 1e-8), -10, 10).astype(np.float32)
    for source, raw in ((alone, alone.predict), (normalising, normalising)):
        with pytest.warns(UserWarning, match="epsilon 1e-8, limit 10"):
            teacher = vsp.agent(source, SIMPLEGOAL, name="mine", normalize=both)
        answer = raw(plain, deterministic=True)[0] if raw != normalising else raw(plain)
        assert np.abs(teacher.predict(OBS)[0] - answer).max() < 1e-6
        unaware = vsp.agent(source, SIMPLEGOAL, name="mine", normalize=False)
        assert teacher.digest != unaware.digest or raw != normalising


@pytest.mark.parametrize("given", [np.True_, {"mean": 0, "var": 1}, (np.zeros(2),), 1, np.zeros(2), open])
def test_anything_else_is_refused(given, small):
    for source in (small, made("SAC", net_arch=[8]), normalising):
        with pytest.raises(ValueError, match="normalize is .*, expected a file of VecNormalize, this object"):
            vsp.agent(source, SIMPLEGOAL, normalize=given)


def test_statistics_of_numpy_are_refused_with_the_way_out(small, tmp_path):
    np.savez(tmp_path / "s.npz", mean=np.zeros(2), var=np.ones(2))
    with pytest.raises(ValueError, match="pass normalize=.mean, variance."):
        vsp.load_teacher(small, SIMPLEGOAL, normalize=tmp_path / "s.npz")


def test_a_wrapper_that_normalises_is_seen(small, tmp_path):
    from stable_baselines3.common.vec_env import DummyVecEnv

    env = gymnasium.wrappers.NormalizeObservation(gymnasium.make(SIMPLEGOAL), epsilon=0.1)
    model = made("SAC", DummyVecEnv([lambda: gymnasium.wrappers.NormalizeReward(env)]), net_arch=[8])
    env.obs_rms.mean, env.obs_rms.var = np.array([0.25, 0.5]), np.array([0.25, 0.1])
    seen = (OBS - env.obs_rms.mean) / np.sqrt(env.obs_rms.var + 0.1)
    expected = model.predict(seen.astype(np.float32), deterministic=True)
    with pytest.warns(UserWarning, match="NormalizeObservation changed them"):
        teacher = vsp.agent(model, SIMPLEGOAL)
    assert np.abs(teacher.predict(OBS)[0] - expected[0]).max() < 1e-6
    model.save(tmp_path / "x.zip")
    with pytest.warns(UserWarning, match="observations have no limits.*pass normalize=.mean, variance."):
        vsp.load_teacher(tmp_path / "x.zip", SIMPLEGOAL)


def test_what_has_no_normalisation_refuses_one(small):
    for source in (SIMPLEGOAL, vsp.load_teacher(small, SIMPLEGOAL)):
        with pytest.raises(ValueError, match="normalize.*expected no"):
            vsp.agent(source, normalize="statistics.pkl")
