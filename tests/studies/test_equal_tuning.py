import importlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from small import SMALL
from support import SIMPLEGOAL

from studies.comparison import equal_tuning, measure
from studies.comparison.equal_tuning import budgets, closest, equal_budget, leaders, with_r2
from studies.comparison.methods import METHODS
from vsp import get_task, load_teacher, start_states, visited_states
from vsp_beyond import faithful_preset, tuned_preset

MODULES = ("studies.comparison.makers", "vsp_beyond.few_cells.tune", "vsp_beyond.few_cells.tuned")
dagger, tune, refine = map(importlib.import_module, MODULES)  # and not the functions


def row(method, size, seed, mean, r2=0.5):
    return {"method": method, "size": size, "seed": seed, "mean": mean, "r2": r2, "failing": 0.0, "cells": size,
            "error_teacher": 0.1, "error_own": 0.1}  # fmt: skip


@pytest.fixture
def rows():
    """Two methods of two sizes, where ours leads at the first and none at the second, and one linear map."""
    found = []
    for seed in range(3):
        for size, ours, theirs in ((2, 9.0, 5.0), (4, 9.5, 9.5)):
            found += [row("our cells, tuned", size, seed, ours + 0.1 * seed), row("our cells", size, seed, 1.0, 0.9)]
            found += [row("CART, DAgger, tuned", size, seed, theirs + 0.1 * seed), row("CART, DAgger", size, seed, 2.0)]
        found += [row("one linear map, tuned", 0, seed, 3.0 + seed), row("one linear map", 0, seed, 0.0)]
    return pd.DataFrame(found)


def test_every_method_stands_beside_its_imitation(rows):
    table = equal_budget(rows)
    assert table["size"].tolist() == [1, 2, 2, 4, 4]
    assert table["method"].tolist()[:3] == ["one linear map", "our cells", "axis tree, constants"]
    own = table.set_index(["size", "method"]).loc[(2, "our cells")]
    assert (own["mean"], own["r2"], own["untuned mean"], own["untuned r2"]) == (pytest.approx(9.1), 0.5, 1.0, 0.9)
    assert own["policies"] == 3 and own["low"] < own["mean"] < own["high"]


def test_who_leads(rows):
    table = leaders(equal_budget(rows))
    assert set(table["rival"]) == {"axis tree, constants"}
    said = [[2, "ours", "1 of 1"], [4, "cannot be told", "0 of 1"]]
    assert table[["size", "ahead", "behind"]].to_numpy().tolist() == said


def test_a_worse_rival_with_few_certain_seeds_hides_no_lead(rows):
    """The lead over the best rival counts, and one method ahead is enough to lose."""
    means = {"CART, DAgger": (1.0, 9.2), "oblique tree, linear leaves, DAgger": (8.0, 8.1)}
    more = [row(f"{name}{end}", 2, seed, mean) for name, both in means.items() for end in ("", ", tuned")
            for seed, mean in enumerate(both)]  # fmt: skip
    ours = rows[rows["method"].str.startswith("our cells")]
    (two,) = leaders(equal_budget(pd.concat([ours, pd.DataFrame(more)]))).to_dict("records")
    assert (two["rival"], two["ahead"], two["behind"]) == ("oblique tree, linear", "ours", "1 of 2")


def test_a_size_without_rivals_is_left_out(rows):
    alone = pd.DataFrame([row("our cells, tuned", 3, 0, 1.0), row("our cells", 3, 0, 1.0)])
    assert equal_budget(pd.concat([rows, alone])).equals(equal_budget(rows))


def test_r2_follows_from_the_action_error_and_from_the_states():
    """By two routes: from the error of a policy, and from its actions."""
    task, teacher = get_task(SIMPLEGOAL), load_teacher(SIMPLEGOAL)
    policy = METHODS["CART"].make(teacher, task, replace(SMALL, n_cells=8), 0)
    starts = start_states(task, measure.N_ERROR, measure.ERROR_SEED)
    frame = pd.DataFrame({"error_teacher": [measure.action_error(policy, teacher, task, starts, by=teacher), 0.0]})
    states = visited_states(teacher, task, starts)
    wanted = teacher.predict(states)[0].astype(np.float64)
    by_hand = 1 - np.square(policy.predict(states)[0] - wanted).mean() / wanted.var(axis=0).mean()
    assert with_r2(frame, SIMPLEGOAL)["r2"].tolist() == pytest.approx([by_hand, 1.0])


def test_what_is_closest_is_as_good(rows):
    more = [row("teacher", 0, 0, 9.0, 1.0), row("faithful", 2, 0, 9.1, 0.8), row("faithful", 4, 0, 8.0, 0.9)]
    found = closest(pd.concat([rows, pd.DataFrame(more)]), SIMPLEGOAL)
    assert (found["size"], found["r2"], found["rival"], found["rival size"]) == (2, 0.8, "CART, DAgger, tuned", 4)


@pytest.mark.parametrize("name", ["our cells, tuned", "one linear map, tuned"])
def test_a_budget_is_what_is_played(monkeypatch, name):
    """By two routes: the formula, and a count of the episodes."""
    task, teacher, played = get_task(SIMPLEGOAL), load_teacher(SIMPLEGOAL), dict.fromkeys(("teacher", "validation"), 0)

    def counting(kind, original, which=lambda policy: True):
        def count(policy, task, starts):
            played[kind] += len(starts) * which(policy)
            return original(policy, task, starts)

        return count

    play = tune.rollout
    monkeypatch.setattr(tune, "rollout_population", lambda policies, *of: [play(policy, *of) for policy in policies])
    for module in (dagger, tune):
        monkeypatch.setattr(module, "rollout", counting("validation", play))
    for module in (dagger, refine):
        count = counting("teacher", module.visited_states, lambda policy: policy is teacher)
        monkeypatch.setattr(module, "visited_states", count)
    how = METHODS[name]
    how.make(teacher, task, SMALL, 0, **how.settings)
    counted = equal_tuning.episodes(name, SMALL, SIMPLEGOAL)
    assert {kind: counted[kind] for kind in played} == played


def test_budgets_of_simplegoal_by_hand():
    table, close, config = budgets(SIMPLEGOAL), faithful_preset(SIMPLEGOAL), tuned_preset(SIMPLEGOAL)
    assert table["method"].tolist() == ["our cells, faithful", "our cells, tuned", "one linear map, tuned"]
    assert table["size"].tolist() == [close.n_cells, config.n_cells, 1] and (table["seconds"] > 0).all()
    # 4 cells of 2 numbers, and of 3 rows for 2 actions: 32 numbers, for which CMA-ES has 14 candidates; of 6, it has 9
    assert table["tuning"].tolist()[1:] == [n * config.n_generations * config.n_tuning_episodes for n in (14, 9)]
    one_map = equal_tuning.episodes("one linear map, tuned", config, "Pendulum-v1")  # 3 inputs, 1 action: 4 numbers
    assert one_map["tuning"] == 8 * config.n_generations * config.n_tuning_episodes
    assert table["teacher"][0] == close.n_episodes + close.n_validation + 20 * close.n_tuning_episodes
