import numpy as np
import pandas as pd
import pytest

from vsp import scale_study, study
from vsp.evaluate import outcomes
from vsp.rollouts import record
from vsp.scale_study import MEASURED, Pursuit, alone, reach


@pytest.mark.parametrize("d", [2, 5, 17])
def test_the_teacher_reaches_the_corner_on_curves(d):
    task = reach(d)
    played = outcomes(Pursuit(), task, 50, seed=0)
    assert (played.codes == 1).mean() > 0.9 and played.lengths.max() <= task.max_steps
    (episode,) = record(Pursuit(), task, np.full((1, d), 0.9))
    actions = np.array([Pursuit().predict(state)[0] for state in episode.states])
    assert actions == pytest.approx(episode.actions) and (np.abs(actions) <= 1).all()


def test_a_step_by_hand():
    states, actions = np.array([[0.3, 0.4], [0.15, 0.05]]), np.array([[-3.0, 0.0], [-1.0, 0.0]])
    moved, rewards, ended = reach(2).step(states, actions)
    assert moved == pytest.approx(np.array([[0.2, 0.4], [0.05, 0.05]]))
    assert rewards == pytest.approx(10 * (np.hypot(*states.T) - np.hypot(*moved.T))) and ended.tolist() == [0, 1]


SMALL = {"distillation": (20,), "evaluation": (50,), "passes": (5, 3), "policies": (3,), "physics": (2,), "runs": (2,)}


@pytest.mark.parametrize("what", SMALL)
def test_everything_is_timed(what):
    found = MEASURED[what](*SMALL[what], **({"jobs": 1} if what == "runs" else {}))
    assert found and all(seconds > 0 for seconds in found.values())


def test_workers_are_timed_here_and_on_a_cluster(monkeypatch):
    asked, seconds = [], iter([9.0, 5.0, 1.0, 2.0, 3.0, 4.0, 9.0, 2.0, 2.0, 2.0, 8.0, 9.0])
    monkeypatch.setattr(scale_study, "runs", lambda n, *, jobs: asked.append((n, jobs)) or {"runs": next(seconds)})
    assert scale_study.workers(2) == {"processes": 3.0, "Dask workers": 2.0}  # the first calls warm them up
    assert [n for n, _ in asked] == [2, *[scale_study.N_RUNS] * 5] * 2 and {jobs for _, jobs in asked[:6]} == {2}
    assert asked[6][1].startswith("tcp://127.0.0.1:") and len({jobs for _, jobs in asked[6:]}) == 1


def test_a_pass_neither_adds_nor_removes_cells(monkeypatch):
    seen = []
    for name in ("split_regions", "merge_regions"):
        original = getattr(scale_study, name)
        monkeypatch.setattr(
            scale_study, name, lambda p, *rest, f=original: seen.append((f(p, *rest), len(p.codewords)))
        )
    scale_study.passes(7, 2)
    assert len(seen) == 2 * scale_study.REPEATS and all(changed == [] and k == 7 for changed, k in seen)


@pytest.mark.parametrize("steps", [3, 100])
def test_an_episode_has_as_many_steps_as_asked(monkeypatch, steps):
    seen = []
    monkeypatch.setattr(scale_study, "split_regions", lambda _, episode, *__: seen.append(episode))
    scale_study.passes(5, 3, steps)
    (_, recorded, _) = scale_study._partition(5, 3)
    assert len(seen[0].states) == len(seen[0].actions) == steps
    assert (seen[0].states[[0, -1]] == recorded[0].states[[0, -1]]).all()
    ends = np.flatnonzero(np.any(np.diff(seen[0].states, axis=0), axis=1))
    assert len(ends) == min(steps, len(recorded[0].states)) - 1  # slower, not further


def test_the_noise_flies_whole_episodes(monkeypatch):
    monkeypatch.setattr(scale_study, "REPEATS", 1)
    played, original = [], scale_study.play
    monkeypatch.setattr(scale_study, "play", lambda *given: played.append(original(*given)) or played[-1])
    (taken,) = scale_study.physics(3).values()
    assert taken > 0 and len(played[0].lengths) == 3 and (played[0].lengths > 30).all()


def test_a_measurement_has_a_process_of_its_own_and_memory_that_is_the_same_each_time():
    first, again, second = (alone("megabytes", "evaluation", n) for n in (2000, 2000, 4000))
    assert first == pytest.approx(again, rel=0.01) and 1.5 < second / first < 2.5
    assert set(alone("seconds", "evaluation", 50)) == {"evaluation"}


def test_the_study_has_a_row_per_thing_and_size(monkeypatch):
    found = {"seconds": lambda what, n, *_: {what: float(n)}, "megabytes": lambda what, n, *_: 10.0 * n}
    seen = []

    def backwards(work, arguments, *_, **__):
        seen.extend(arguments)
        return ((i, work(*arguments[i])) for i in reversed(range(len(arguments))))

    monkeypatch.setattr(scale_study, "alone", lambda quantity, *work: found[quantity](*work))
    monkeypatch.setattr(scale_study, "results", backwards)
    sizes = {"episodes": (10,), "cells": (5,), "dimensions": (2, 3), "steps": (7,), "n_runs": (1,), "n_workers": (1, 2)}
    frame = scale_study.study(**sizes)
    timed, held = frame[frame["seconds"].notna()], frame[frame["megabytes"].notna()]
    assert timed.groupby("over")["size"].agg(list).to_dict() == {
        "cells": [5], "copies": [50], "dimensions": [2, 3, 2, 3], "episodes": [10, 10], "runs": [1], "steps": [7],
        "workers": [1, 2],
    }  # fmt: skip
    assert held.groupby("what")["size"].agg(sorted).to_dict() == {
        "a partition": [2, 3, 5], "distillation": [10], "evaluation": [10]
    }  # fmt: skip
    sized = held[held["over"] != "dimensions"]
    assert (sized["megabytes"] == 10 * sized["size"]).all() and len(timed) + len(held) == len(frame)
    assert seen[0] == ("megabytes", "distillation", 10) and frame["machine"].nunique() == 1  # the largest first


def test_the_command_writes_a_listed_table(monkeypatch, tmp_path):
    frame = pd.DataFrame({"what": ["x"], "seconds": [1.5]})
    monkeypatch.setattr(scale_study, "study", lambda: frame)
    monkeypatch.setattr("sys.argv", ["x", "--out", str(tmp_path)])
    scale_study.main()
    monkeypatch.setattr(study, "RESULTS", tmp_path / "data" / "results")
    assert study.read("scale").equals(frame)
