import dataclasses

import pytest
from support import MOUNTAINCAR, SIMPLEGOAL, TASKS, TINY, tiny

import vsp
from vsp.config import EXTENSIONS, Config, paper_preset
from vsp.paper.printed import printed_hyperparameters

INTEGERS = ("n_epochs", "n_split", "n_merge", "n_freeze", "n_reset", "batch_size", "n_minibatches")
NUMBERS = ("min_param_distance", "min_pol_distance", "max_pol_loss", "learning_rate")
WORDS = (
    "freeze", "split_metric", "periodic_reset", "initial", "adam_on_reset", "scale", "neighbours", "split_loss",
    "merge_parameters", "sub_policy", "fit",
)  # fmt: skip
FLAGS = ("one_split", "inclusive")


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
@pytest.mark.parametrize("value", [0, 1.5, True])
def test_a_bad_integer_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected a positive integer"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [0, float("nan"), "0.1"])
def test_a_bad_number_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected a positive number"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize("value", ["typo", None])
def test_a_bad_word_is_shown_with_the_choices(name, value):
    with pytest.raises(ValueError, match=rf"{name} is {value!r}, expected one of \['{getattr(TINY, name)}"):
        tiny(**{name: value})


@pytest.mark.parametrize("name", FLAGS)
@pytest.mark.parametrize("value", [1, None])
def test_a_bad_flag_is_shown(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}, expected True or False"):
        tiny(**{name: value})


def test_a_freeze_longer_than_the_run_is_refused():
    with pytest.raises(ValueError, match="n_freeze is 121, expected at most n_epochs = 120"):
        tiny(n_freeze=121)
    assert tiny(n_freeze=120).n_freeze == 120


def test_extensions_at_rest_are_no_part_of_the_settings():
    """So runs that were made before there were any keep the name of their folder."""
    plain = TINY.settings()
    assert set(dataclasses.asdict(TINY)) - set(plain) == set(EXTENSIONS) and plain["neighbours"] == "delaunay"
    assert all(getattr(TINY, name) == value for name, value in EXTENSIONS.items())
    assert tiny(fit="closed_form").settings() == {**plain, "fit": "closed_form"}


def test_an_unknown_task_and_an_unknown_field():
    with pytest.raises(ValueError, match="unknown task 'Pendulum', expected one of .*; did you mean 'Pendulum-v1'"):
        paper_preset("Pendulum")
    with pytest.raises(ValueError, match="no settings for task 'Pendulum-v1', .*: write a Config.*vsp_beyond.faithful"):
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


@pytest.mark.parametrize("kind", ["faithful", "tuned"])
def test_another_kind_of_preset_names_the_new_call(kind):
    with pytest.raises(ValueError, match=rf"call vsp_beyond\.{kind}\("):
        vsp.preset(TASKS[0], kind, n_cells=2)
