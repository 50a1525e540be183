import ast
import dataclasses
import inspect

import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL

import vsp
from vsp.config import Config
from vsp_beyond import Faithful, Tuned, faithful_preset, limit_preset, tuned_preset

TRIED = (SIMPLEGOAL, MOUNTAINCAR, PENDULUM, LUNARLANDER)


@pytest.mark.parametrize("preset", [faithful_preset, tuned_preset, limit_preset])
def test_any_task_has_settings_that_suit_its_size(preset):
    """A physics engine steps one state at a time: fewer episodes there."""
    assert all(preset(task).n_cells <= 8 for task in TRIED)
    walker = preset("BipedalWalker-v3")
    like_pendulum = preset(dataclasses.replace(vsp.get_task(PENDULUM), name="My-v0"))
    assert walker.n_episodes == 100 < like_pendulum.n_episodes
    assert walker.n_tuning_episodes < like_pendulum.n_tuning_episodes
    assert all(limit_preset(task).n_generations > tuned_preset(task).n_generations for task in TRIED)


def test_two_numbers_choose_a_faithful_policy():
    config = faithful_preset(PENDULUM, n_cells=3, min_r2=0.9)
    assert config == dataclasses.replace(faithful_preset(PENDULUM), n_cells=3, min_r2=0.9)
    with pytest.raises(ValueError, match="n_cells is 0, expected an integer from 1 to 1000"):
        faithful_preset(PENDULUM, n_cells=0)


def test_episodes_have_a_limit_where_they_are_short():
    short = dataclasses.replace(vsp.get_task(PENDULUM), name="Short-v0", max_steps=5)
    assert faithful_preset(short).n_episodes == 30_000


def test_numbers_of_no_sense_are_refused():
    assert Tuned(n_cells=3, initial_temperature=1.0, final_temperature=1.0).final_temperature == 1.0
    with pytest.raises(ValueError, match="final_temperature is 2.0, expected at most initial_temperature = 1.0"):
        Tuned(n_cells=3, final_temperature=2.0)
    with pytest.raises(ValueError, match="n_episodes is 10{12}, expected"):
        Faithful(n_cells=3, n_episodes=10**12)
    with pytest.raises(ValueError, match="n_generations is False"):
        Tuned(n_cells=3, n_generations=False)


def test_quick_keeps_the_cells_and_what_is_off():
    quick = Tuned(n_cells=3, n_generations=0, n_corrections=0, failure_penalty=0).quick()
    assert (quick.n_cells, quick.n_steps, quick.n_generations, quick.n_corrections) == (3, 150, 0, 0)
    assert Tuned(n_cells=3, n_episodes=4).quick().n_episodes == 1
    quick = Faithful(n_cells=3, tolerance=1.0, n_generations=0, n_restarts=4).quick()
    assert (quick.n_cells, quick.n_restarts, quick.n_episodes, quick.n_generations) == (3, 1, 3000, 0)


@pytest.mark.parametrize("kind", [Config, Tuned, Faithful])
def test_every_field_says_what_it_is(kind):
    body = ast.parse(inspect.getsource(kind)).body[0].body
    documented = {
        field.target.id
        for field, text in zip(body, body[1:])
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }
    assert documented == {field.name for field in dataclasses.fields(kind)}
