"""Environments of Gymnasium as tasks: how many are open, and which do not fit."""

import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import NormalizeObservation
from support import Constant

import vsp
from vsp.tasks import registry


class Counted(gymnasium.Env):
    """Ends after as many steps as its seed says; counts how many are open, and the most so far."""

    observation_space = gymnasium.spaces.Box(-0.7, 0.7, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self):
        Counted.open, Counted.made = Counted.open + 1, Counted.made + 1
        Counted.most, self.number = max(Counted.most, Counted.open), Counted.made

    def meet(self, method):
        if (method, self.number) in Counted.troubles:
            raise Counted.troubles[method, self.number]

    def reset(self, *, seed=None, options=None):
        self.meet("reset")
        self.left = seed
        return np.array([self.first]), {}

    def step(self, action):
        self.meet("step")
        self.left -= 1
        return np.array([0.1 * self.left]), float(action[0]), self.left == 0, False, {}

    def close(self):
        Counted.open -= 1
        self.meet("close")


@pytest.fixture
def registered(monkeypatch):
    """A function that registers an environment, for one test. The first observation is just beyond float32(0.7)."""
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    monkeypatch.setattr(gymnasium, "registry", gymnasium.envs.registration.registry)
    Counted.open, Counted.most, Counted.made, Counted.troubles, Counted.first = 0, 0, 0, {}, 0.7

    def add(entry=Counted, **about):
        gymnasium.registry.pop("Counted-v0", None)
        gymnasium.register("Counted-v0", entry_point=entry, max_episode_steps=9, **about)
        return "Counted-v0"

    return add


def test_few_environments_are_open_at_once_and_results_keep_the_order_of_starts(registered):
    task, starts = replace(vsp.get_task(registered()), at_once=3), np.array([[n] for n in (3, 1, 2, 5, 4, 1, 2)])
    result = vsp.rollout(Constant(0.5), task, starts)
    episodes = vsp.collect_episodes(Constant(0.5), task, starts)
    assert result.lengths.tolist() == [len(e.states) for e in episodes] == starts[:, 0].tolist()
    assert result.returns.tolist() == (0.5 * starts[:, 0]).tolist() and set(result.outcomes) == {vsp.tasks.base.ENDED}
    assert episodes[3].states[:, 0] == pytest.approx([0.7, 0.4, 0.3, 0.2, 0.1])
    assert (Counted.open, Counted.most, Counted.made) == (0, 3, 1 + 2 * 7) and vsp.get_task("Counted-v0").at_once == 500


@pytest.mark.parametrize("method", ["reset", "step", "close"])
@pytest.mark.parametrize("trouble", [OSError("out of files"), KeyboardInterrupt()])
def test_all_environments_are_closed_after_an_error(registered, method, trouble):
    task = replace(vsp.get_task(registered()), at_once=4)
    Counted.troubles[method, 7] = trouble  # the second of the second four; the first was opened to read its boxes
    with pytest.raises(type(trouble)):
        vsp.rollout(Constant(0.5), task, np.full((9, 1), 2.0))
    assert Counted.open == 0 and 7 <= Counted.made < 10


def test_starts_are_checked_before_any_environment_opens(registered):
    task, made = vsp.get_task(registered()), Counted.made
    with pytest.raises(ValueError, match="start states hold nan"):
        vsp.rollout(Constant(0.5), task, [[1.0], [np.nan]])
    assert Counted.made == made
    Counted.first = 0.75
    with pytest.raises(ValueError, match=r"first observation \[0.75\] lies outside the box of Counted-v0"):
        vsp.rollout(Constant(0.5), task, [[3.0]])


def test_an_environment_of_old_gym_is_refused_by_name(registered):
    for method, old, expected in (
        ("reset", lambda self, **_: np.zeros(1), r"gives array\(\[0.\]\), expected .observation, info"),
        ("reset", lambda self: np.zeros(1), "gives .an error for a seed., expected .observation, info"),
        ("step", lambda self, _: (np.zeros(1), 0.0, True, {}), "gives .*True.*, expected .*terminated, truncated"),
    ):
        name = registered(type("Old", (Counted,), {method: old}))
        with pytest.raises(ValueError, match=f"`{method}` of Counted-v0 {expected}.*: change it from old Gym's API"):
            vsp.evaluate(Constant(0.0), name, 2, seed=0)
        assert Counted.open == 0


def test_a_name_may_tell_the_module_that_registers_it_but_not_in_a_file(registered, monkeypatch, tmp_path):
    code = "import gymnasium as g; g.register('Far-v0', entry_point='test_engines:Counted', max_episode_steps=9)"
    (tmp_path / "far_away.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(registry, "_ADDED", {})
    assert registry.saved_task("far_away:Far-v0", ["x"], ["F"], {}.fromkeys(registry.BOX)).max_steps == 1
    assert "far_away" not in sys.modules
    assert vsp.register("far_away:Far-v0", inputs=["x"]) is vsp.get_task("far_away:Far-v0") is vsp.get_task("Far-v0")
    with pytest.raises(ImportError, match="No module named 'nowhere'"):
        vsp.get_task("nowhere:Far-v0")


def test_statistics_that_start_anew_are_refused_but_not_fixed_ones(registered):
    wrapped, by_wrapper = NormalizeObservation(Counted()), (NormalizeObservation.wrapper_spec(epsilon=1e-8),)
    for about in ({"entry": lambda: wrapped}, {"additional_wrappers": by_wrapper}):
        with pytest.raises(ValueError, match="NormalizeObservation in Counted-v0 start anew .* raw .*normalize="):
            vsp.get_task(registered(**about))
    wrapped.update_running_mean = False
    assert vsp.get_task(registered(lambda: wrapped)).name == "Counted-v0"


@pytest.mark.filterwarnings("ignore:.*out of date")
def test_an_environment_that_does_not_open_or_act_in_floats_is_refused_with_a_way_out(registered):
    whole = type("Whole", (Counted,), {"action_space": gymnasium.spaces.Box(-2, 2, (1,), np.int64)})
    for name, why in (
        ("HalfCheetah-v3", "^cannot open HalfCheetah-v3: use HalfCheetah-v5$"),
        ("LunarLander-v3", "Discrete.* such as LunarLanderContinuous-v3$"),
        (registered(whole), r"int64\), expected floats, as -1.9 would act as -1: round in `step`"),
    ):
        with pytest.raises(ValueError, match=why):
            vsp.get_task(name)
