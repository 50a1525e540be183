import dataclasses

import pandas as pd
import pytest

from vsp.beyond.comparison import time_to_quality
from vsp.beyond.comparison.time_to_quality import ENOUGH, METHODS, OURS, TREES, provenance_of, quickest


def test_every_setting_runs_with_every_seed(monkeypatch):
    few = {"n_episodes": 20, "n_correction_episodes": 5, "n_validation": 20, "n_steps": 20}
    for name, (make, settings) in METHODS.items():
        two = {setting: dataclasses.replace(config, **few) for setting, config in list(settings.items())[:2]}
        monkeypatch.setitem(METHODS, name, (make, two))
    monkeypatch.setattr(time_to_quality, "N_REPORTED", 50)
    frame = time_to_quality.time_to_quality(range(2))
    assert len(frame) == 12 and frame.groupby(["method", "setting"]).size().tolist() == [2] * 6
    assert (frame["seconds"] > 0).all() and frame["failing"].between(0, 1).all()
    assert (frame["mean"] / frame["share"]).std() == pytest.approx(0, abs=1e-9)  # all by one teacher's
    for row in frame.to_dict("records"):
        assert row.items() >= provenance_of(row["method"], row["setting"]).items()
    again = time_to_quality.time_to_quality(range(2))
    assert again.drop(columns="seconds").equals(frame.drop(columns="seconds"))


def test_settings_are_not_tuned_and_have_one_beginning():
    for config in (*OURS.values(), *TREES.values()):
        assert (config.n_generations, config.n_restarts, config.n_corrections) == (0, 1, 2)


def test_the_quickest_that_is_good_enough_by_hand():
    settings = [("trees", "small", 0.1, 0.95), ("trees", "large", 2.0, 0.991), ("trees", "huge", 3.0, 0.999)]
    settings += [("cells", "few", 1.0, 0.995), ("none", "any", 0.01, 0.98)]
    rows = [
        {"method": method, "setting": setting, "seed": seed, "seconds": seconds * spread, "mean": share * 10 * spread,
         "failing": 0.0, "share": share * spread}
        for method, setting, seconds, share in settings for seed, spread in enumerate((0.5, 1.0, 1.5))
    ]  # fmt: skip
    found = quickest(pd.DataFrame(rows))
    assert found[["method", "setting", "seconds"]].values.tolist() == [["cells", "few", 1.0], ["trees", "large", 2.0]]
    assert found["share"].tolist() == [0.995, 0.991] and ENOUGH == 0.99
    assert found["crossing"].tolist() == [2 / 3, 2 / 3]  # the median and what is above it
