import dataclasses

import pytest
from support import TASKS, TINY, tiny

from vsp.config import EXTENSIONS, paper_preset


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


def test_a_task_that_is_not_of_the_paper_is_answered_with_a_way_out():
    with pytest.raises(ValueError, match="no settings for task 'Pendulum-v1', .*: write a Config.*vsp_beyond.faithful"):
        paper_preset("Pendulum-v1")


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
