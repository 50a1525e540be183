import time
from dataclasses import replace

import numpy as np
from support import SIMPLEGOAL, CurvedTeacher

from vsp.tasks.registry import get_task
from vsp_beyond.few_cells import duration, faithful, search
from vsp_beyond.few_cells.config import Faithful
from vsp_beyond.few_cells.tune import candidates_per_generation, cma_es
from vsp_beyond.few_cells.units import Cells

SMALL = Faithful(n_cells=3, n_episodes=100, n_restarts=4, n_generations=10, n_tuning_episodes=50, n_validation=100)


def test_episodes_and_losses_are_counted(monkeypatch):
    """Where an episode of the teacher takes a second, one of cells three, and a loss two."""
    monkeypatch.setattr(duration, "_of_an_episode", lambda *_: (1.0, 3.0))
    monkeypatch.setattr(duration, "_one_loss", lambda task, config: 2.0)
    fit, tuning = duration.expected_seconds(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL)
    assert fit == 100 + 100 + 3 * 100 + 2.0 * duration._losses(4, SMALL.n_states)
    # 3 cells of 2 numbers, and of 3 rows for 2 actions: 24 numbers, for which CMA-ES has 13 candidates
    assert tuning == 3 * (10 * 13 * 50 + faithful.SNAPSHOTS * 100) + faithful.POOL * 50


def test_what_takes_time_is_timed():
    fit, tuning = duration.expected_seconds(CurvedTeacher(), get_task(SIMPLEGOAL), SMALL)
    _, slower = duration.expected_seconds(Slow(), get_task(SIMPLEGOAL), SMALL)
    _, longer = duration.expected_seconds(CurvedTeacher(), get_task(SIMPLEGOAL), replace(SMALL, n_generations=1000))
    assert slower > 3 * tuning > 0 < fit and longer > 3 * tuning


class Slow(CurvedTeacher):
    """Takes a while for each batch."""

    def predict(self, obs):
        time.sleep(0.05)
        return super().predict(obs)


def test_losses_are_counted_as_the_search_computes_them(monkeypatch):
    rng, counted = np.random.default_rng(0), []
    monkeypatch.setattr(search, "descend", lambda seen, cells, stages, **_: counted.append(len(stages)) or cells)
    monkeypatch.setattr(search, "squared_error", lambda *_: 0.0)
    monkeypatch.setattr(search, "local_maps", lambda *_: Cells(np.eye(3, 2), np.zeros((3, 3, 1))))
    monkeypatch.setattr(search, "spread", lambda *_: None)

    class Seen:
        inputs = np.zeros((1, 3))

        def rows(self, _):
            return self

    search.least_error(Seen(), 3, 20, rng)
    *rounds, last = counted
    assert duration._losses(20, search.FEW) == search.N_ITERATIONS * sum(rounds) + search.N_LAST * last


def test_the_time_is_estimated_where_all_starts_are_alike():
    fixed = replace(get_task(SIMPLEGOAL), name="fixed", start=lambda rng, n: np.tile([[0.9, 0.6]], (n, 1)))
    assert duration.announcement(CurvedTeacher(), fixed, SMALL).startswith("about")


def test_words_for_seconds():
    found = [duration.in_words(seconds) for seconds in (0.3, 18.0, 89.0, 100.0, 400.0)]
    assert found == ["about 5 seconds", "about 20 seconds", "about 90 seconds", "about 2 minutes", "about 7 minutes"]


def test_a_generation_has_as_many_candidates_as_the_search_asks_for():
    rng = np.random.default_rng(0)
    for n in (2, 7, 32, 90):
        assert len(cma_es(np.zeros(n), 0.1, rng).ask()) == candidates_per_generation(n)
