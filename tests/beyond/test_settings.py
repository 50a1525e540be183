import dataclasses

import pytest
from support import LUNARLANDER, PENDULUM, TASKS

import vsp
import vsp_beyond
from vsp.config import Config
from vsp_beyond import Faithful, Tuned


def test_tasks_that_were_tried_have_a_tuned_preset():
    for task in (*TASKS, PENDULUM, LUNARLANDER):
        assert isinstance(vsp_beyond.tuned_preset(task), Tuned) and vsp_beyond.tuned_preset(task).n_cells <= 5


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 0}, {"n_cells": 2.0}, {"n_restarts": 0}, {"n_corrections": -1}, {"n_generations": True},
     {"clip_slope": 0}, {"final_temperature": 2.0}, {"learning_rate": float("nan")}, {"n_corrections": 0.0}],
)  # fmt: skip
def test_a_refinement_out_of_range_is_refused(change):
    ((name, value),) = change.items()
    with pytest.raises(ValueError, match=f"{name} is {value}, expected"):
        Tuned(**{"n_cells": 3, **change})


def test_parts_of_a_refinement_can_be_switched_off():
    assert Tuned(n_cells=1, n_corrections=0, n_generations=0, failure_penalty=0).n_corrections == 0


def test_a_quick_refinement_keeps_its_cells_and_what_is_off():
    quick = Tuned(n_cells=3, n_generations=0).quick()
    assert (quick.n_cells, quick.n_steps, quick.n_generations) == (3, 150, 0)
    assert Tuned(n_cells=3, n_episodes=4).quick().n_episodes == 1


def test_the_faithful_presets_have_few_cells():
    for task in ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1"):
        assert isinstance(vsp_beyond.faithful_preset(task), Faithful) and vsp_beyond.faithful_preset(task).n_cells <= 8


def test_any_task_has_faithful_settings_that_suit_its_size():
    """A physics engine steps one state at a time: fewer episodes there."""
    walker, pendulum = vsp_beyond.faithful_preset("BipedalWalker-v3"), vsp_beyond.faithful_preset("Pendulum-v1")
    assert walker.n_episodes == 100 < pendulum.n_episodes and walker.n_tuning_episodes < pendulum.n_tuning_episodes
    copy = dataclasses.replace(vsp.get_task("Pendulum-v1"), name="My-v0")
    assert (
        vsp_beyond.faithful_preset(copy).n_episodes == 300_000 // 200
        and vsp_beyond.faithful_preset(copy).tolerance is None
    )


def test_two_numbers_choose_a_faithful_policy():
    config = vsp_beyond.faithful_preset("Pendulum-v1", n_cells=3, min_r2=0.9)
    assert config == dataclasses.replace(vsp_beyond.faithful_preset("Pendulum-v1"), n_cells=3, min_r2=0.9)
    with pytest.raises(ValueError, match="n_cells is 0, expected an integer from 1 to 1000"):
        vsp_beyond.faithful_preset("Pendulum-v1", n_cells=0)


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 0}, {"tolerance": 0}, {"tolerance": float("inf")}, {"margin": float("nan")}, {"n_restarts": True},
     {"n_generations": -1}, {"failure_penalty": -1.0}, {"n_states": 10.0}, {"min_r2": 1.01}, {"n_cells": 10**9},
     {"n_episodes": 10**12}],
)  # fmt: skip
def test_a_faithful_out_of_range_is_refused(change):
    ((name, value),) = change.items()
    with pytest.raises(ValueError, match=f"{name} is {value}, expected"):
        Faithful(**{"n_cells": 3, "tolerance": 1.0, **change})


def test_a_quick_faithful_keeps_its_cells_and_what_is_off():
    quick = Faithful(n_cells=3, tolerance=1.0, n_generations=0, n_restarts=4).quick()
    assert (quick.n_cells, quick.n_restarts, quick.n_episodes, quick.n_generations) == (3, 1, 3000, 0)


@pytest.mark.parametrize("kind", [Config, Tuned, Faithful])
def test_every_field_says_what_it_is(kind):
    import ast
    import inspect

    body = ast.parse(inspect.getsource(kind)).body[0].body
    documented = {
        field.target.id
        for field, text in zip(body, body[1:])
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }
    assert documented == {f.name for f in dataclasses.fields(kind)}
