import dataclasses

import numpy as np
import pandas as pd
import pytest
from support import SIMPLEGOAL, CurvedTeacher, tiny

from vsp import store
from vsp.envs import GOAL, PIT, TRUNCATED
from vsp.evaluate import outcomes, spread
from vsp.experiments import EVALUATION_SEED, Experiment, Results, make_runs
from vsp.summaries import comparison, overview, summary, write_summary

SMALL = Experiment(SIMPLEGOAL, tiny(n_epochs=30, n_freeze=5), CurvedTeacher(), n_episodes=20)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Three runs, in a folder that tests only read."""
    runs = make_runs(SMALL, range(3), runs=tmp_path_factory.mktemp("runs"))
    return Results(SMALL, runs, outcomes(SMALL.teacher, SIMPLEGOAL, 20, seed=EVALUATION_SEED))


def test_overview_and_comparison_by_hand(results):
    table = overview(results)
    cells = [len(run.policy) for run in results.runs]
    assert table.loc["cells"].tolist() == [np.mean(cells), min(cells), max(cells)]
    facts = comparison(results)
    means = results.returns.mean(axis=1)
    assert facts["TD3, mean"] == results.teacher_returns.mean() and facts["lowest run"] == means.min()
    assert facts["95 % interval from"] <= facts["distilled, mean"] <= facts["to"]
    gap = facts["distilled, mean"] - facts["TD3, mean"]
    assert facts["difference, from"] <= gap <= facts["difference, to"]
    assert facts["runs above TD3"] == np.mean([mean > facts["TD3, mean"] for mean in means])
    independent = 1.96 * results.returns.std(ddof=1) / np.sqrt(60)
    assert facts["± if independent"] == pytest.approx(independent)


def test_summary_tells_each_run(results):
    frame = summary(results.runs, SMALL)
    assert frame["seed"].tolist() == [0, 1, 2] and set(frame["settings"]) == {SMALL.id}
    assert np.allclose(frame[["goal", "pit", "truncated"]].sum(axis=1), 1)
    for row, run in zip(frame.to_dict("records"), results.runs):
        assert row["cells"] == len(run.policy) == 1 + row["splits"] - row["merges"]
        assert {name: row[name] for name in spread(run.outcomes.returns)} == spread(run.outcomes.returns)
        assert row["pit"] == np.mean(run.outcomes.codes == PIT) and row["goal"] == np.mean(run.outcomes.codes == GOAL)
        assert row["truncated"] == np.mean(run.outcomes.codes == TRUNCATED)


def test_write_summary_keeps_a_row_per_run_and_where_it_was_made(results, tmp_path):
    mixed = dataclasses.replace(results, runs=[dataclasses.replace(results.runs[0], cpu="other"), *results.runs[1:]])
    write_summary(mixed, out=tmp_path)
    folder = tmp_path / "data" / "results"
    frame = store.read_table(folder / f"{SIMPLEGOAL}.csv")
    pd.testing.assert_frame_equal(frame, summary(results.runs, SMALL), check_dtype=False, atol=1e-6, rtol=0)
    made_on = store.read_listed(folder / "made_on.txt")
    assert made_on.decode().splitlines() == sorted({"other", results.runs[1].cpu})
