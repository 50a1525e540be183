import dataclasses

import pytest
from support import LUNARLANDER, MOUNTAINCAR, PENDULUM, SIMPLEGOAL, TASKS, TINY, tiny

import vsp
from vsp.beyond.refinement.config import Faithful, Refinement
from vsp.config import EXTENSIONS, Config, paper_preset
from vsp.paper.printed import printed_hyperparameters

INTEGERS = ("n_epochs", "n_split", "n_merge", "n_freeze", "n_reset", "batch_size", "n_minibatches")
NUMBERS = ("min_param_distance", "min_pol_distance", "max_pol_loss", "learning_rate")
WORDS = (
    "freeze", "split_lookup", "split_metric", "periodic_reset", "merge_reset", "initial", "adam_on_reset", "scale",
    "neighbours", "split_loss", "merge_parameters", "split_reset", "split_neighbours", "loss_after_split",
    "sub_policy", "fit",
)  # fmt: skip
FLAGS = ("one_split", "merge_visits_removed", "inclusive")


def test_the_lists_above_name_every_field():
    assert sorted(INTEGERS + NUMBERS + WORDS + FLAGS) == sorted(f.name for f in dataclasses.fields(Config))


@pytest.mark.parametrize("task", TASKS)
def test_a_preset_is_the_papers_table(task):
    printed = printed_hyperparameters(task)
    assert {name: getattr(paper_preset(task), name) for name in printed} == printed


def test_presets_by_hand():
    goal, car = paper_preset(SIMPLEGOAL), paper_preset(MOUNTAINCAR)
    assert (goal.n_epochs, goal.n_split, goal.n_freeze, goal.max_pol_loss) == (5000, 20, 1000, 1e-4)
    assert (car.n_epochs, car.n_split, car.n_freeze, car.min_pol_distance) == (2000, 50, 400, 0.04)


@pytest.mark.parametrize("name", INTEGERS)
@pytest.mark.parametrize("value", [0, -1, 1.5, 2.0, "3", None, True])
def test_a_bad_integer_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected a positive integer"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [0, -1e-9, float("nan"), float("inf"), "0.1", None, False])
def test_a_bad_number_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected a positive number"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize("value", ["typo", "", None, True])
def test_a_bad_word_is_shown_with_the_choices(name, value):
    with pytest.raises(ValueError, match=rf"{name} is {value!r}, expected one of \['{getattr(TINY, name)}"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", FLAGS)
@pytest.mark.parametrize("value", [0, 1, "yes", None])
def test_a_bad_flag_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected True or False"):
        tiny(**{name: value})


def test_a_freeze_longer_than_the_run_is_refused():
    with pytest.raises(ValueError, match="n_freeze is 121, expected at most n_epochs = 120"):
        tiny(n_freeze=121)
    assert tiny(n_freeze=120).n_freeze == 120


@pytest.mark.parametrize("change", [{"fit": "closed_form"}, {"initial": "zeros"}])
def test_what_a_network_cannot_do_is_refused(change):
    ((name, value),) = change.items()
    with pytest.raises(ValueError, match=f"{name} is '{value}', expected '.*' for networks"):
        tiny(sub_policy="network", **change)
    assert getattr(tiny(sub_policy="quadratic", **change), name) == value


def test_extensions_at_rest_are_no_part_of_the_settings():
    """So runs that were made before there were any keep the name of their folder."""
    plain = TINY.settings()
    assert set(dataclasses.asdict(TINY)) - set(plain) == set(EXTENSIONS) and plain["neighbours"] == "delaunay"
    assert all(getattr(TINY, name) == value for name, value in EXTENSIONS.items())
    assert tiny(fit="closed_form").settings() == {**plain, "fit": "closed_form"}
    assert tiny(neighbours="visited").settings() == {**plain, "neighbours": "visited"}


def test_an_unknown_task_and_an_unknown_field():
    with pytest.raises(ValueError, match="unknown task 'Pendulum', expected one of .*; did you mean 'Pendulum-v1'"):
        paper_preset("Pendulum")
    with pytest.raises(ValueError, match="no settings for task 'Pendulum-v1', .*: take .*'faithful'.*write a Config"):
        paper_preset("Pendulum-v1")
    with pytest.raises(TypeError, match="n_spilt"):
        tiny(n_spilt=3)


def test_a_config_never_changes():
    with pytest.raises(dataclasses.FrozenInstanceError):
        TINY.n_epochs = 1


@pytest.mark.parametrize("task", TASKS)
def test_quick_is_a_tenth_and_nothing_else(task):
    quick = paper_preset(task).quick()
    assert (quick.n_epochs, quick.n_freeze) == (paper_preset(task).n_epochs // 10, paper_preset(task).n_freeze // 10)
    changed = dataclasses.replace(quick, n_epochs=paper_preset(task).n_epochs, n_freeze=paper_preset(task).n_freeze)
    assert changed == paper_preset(task)


@pytest.mark.parametrize(("n_epochs", "n_freeze"), [(5, 1), (100, 5), (9, 9)])
def test_quick_of_a_short_config_is_still_one(n_epochs, n_freeze):
    quick = tiny(n_epochs=n_epochs, n_freeze=n_freeze).quick()
    assert 0 < quick.n_freeze <= quick.n_epochs <= n_epochs


# Refinement


def test_tasks_that_were_tried_have_a_tuned_preset():
    for task in (*TASKS, PENDULUM, LUNARLANDER):
        assert isinstance(vsp.preset(task, "tuned"), Refinement) and vsp.preset(task, "tuned").n_cells <= 5
    with pytest.raises(ValueError, match="kind is 'finest', expected one of \\['paper', 'faithful', 'tuned'\\]"):
        vsp.preset(TASKS[0], "finest")


@pytest.mark.parametrize(
    "change",
    [{"n_cells": 0}, {"n_cells": 2.0}, {"n_restarts": 0}, {"n_corrections": -1}, {"n_generations": True},
     {"clip_slope": 0}, {"final_temperature": 2.0}, {"learning_rate": float("nan")}, {"n_corrections": 0.0}],
)  # fmt: skip
def test_a_refinement_out_of_range_is_refused(change):
    ((name, value),) = change.items()
    with pytest.raises(ValueError, match=f"{name} is {value}, expected"):
        Refinement(**{"n_cells": 3, **change})


def test_parts_of_a_refinement_can_be_switched_off():
    assert Refinement(n_cells=1, n_corrections=0, n_generations=0, failure_penalty=0).n_corrections == 0


def test_a_quick_refinement_keeps_its_cells_and_what_is_off():
    quick = Refinement(n_cells=3, n_generations=0).quick()
    assert (quick.n_cells, quick.n_steps, quick.n_generations) == (3, 150, 0)
    assert Refinement(n_cells=3, n_episodes=4).quick().n_episodes == 1


def test_the_faithful_presets_have_few_cells():
    for task in ("SimpleGoal-v0", "MountainCarContinuous-v0", "Pendulum-v1"):
        assert isinstance(vsp.preset(task, "faithful"), Faithful) and vsp.preset(task, "faithful").n_cells <= 8


def test_any_task_has_faithful_settings_that_suit_its_size():
    """A physics engine steps one state at a time: fewer episodes there."""
    walker, pendulum = vsp.preset("BipedalWalker-v3", "faithful"), vsp.preset("Pendulum-v1", "faithful")
    assert walker.n_episodes == 100 < pendulum.n_episodes and walker.n_tuning_episodes < pendulum.n_tuning_episodes
    copy = dataclasses.replace(vsp.get_task("Pendulum-v1"), name="My-v0")
    assert vsp.preset(copy, "faithful").n_episodes == 300_000 // 200 and vsp.preset(copy, "faithful").tolerance is None


def test_two_numbers_choose_a_faithful_policy():
    config = vsp.preset("Pendulum-v1", "faithful", n_cells=3, min_r2=0.9)
    assert config == dataclasses.replace(vsp.preset("Pendulum-v1", "faithful"), n_cells=3, min_r2=0.9)
    with pytest.raises(ValueError, match="n_cells and min_r2 choose a 'faithful' policy, but kind is 'tuned'"):
        vsp.preset("Pendulum-v1", "tuned", n_cells=3)
    with pytest.raises(ValueError, match="n_cells is 0, expected an integer from 1 to 1000"):
        vsp.preset("Pendulum-v1", "faithful", n_cells=0)


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


@pytest.mark.parametrize("kind", [Config, Refinement, Faithful])
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
