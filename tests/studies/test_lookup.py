import time

import numpy as np
import pandas as pd
import pytest

from studies.benchmarks import lookup
from studies.benchmarks.lookup import GRAPHS, LOOKUPS, SIZES, agreement, codewords, nearest_by_product, witness_graph
from vsp import geometry
from vsp.paper import results

CORNERS = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.8, 0.8]])


def edges(graph):
    assert graph.dtype == bool and np.array_equal(graph, graph.T) and not graph.diagonal().any()
    return {(int(i), int(j)) for i, j in np.argwhere(graph) if i < j}


# The pieces


@pytest.mark.parametrize("d", [2, 5])
def test_the_product_finds_what_the_distances_say(d):
    points, states = codewords(d, 40), np.random.default_rng(0).random((500, d))
    assert np.array_equal(nearest_by_product(points, states), geometry.nearest(points, states, "euclidean"))
    assert nearest_by_product(np.array([[0.0], [1.0]]), np.array([[0.4], [0.7], [0.5]])).tolist() == [0, 1, 0]


def test_touching_by_hand():
    """A square with one corner moved out, so that cells 1 and 2 touch between the two others."""
    assert edges(lookup.touching(CORNERS)) == {(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)}


def test_what_touches_outside_the_cube_only_does_not_count():
    line = np.array([[0.1, 0.5], [0.5, 0.45], [0.9, 0.5]])  # 0 and 2 touch far above, at y = 1.9
    assert edges(lookup.touching(line)) == {(0, 1), (1, 2)} and edges(geometry.delaunay_neighbours(line)) >= {(0, 2)}


@pytest.mark.parametrize("d", [2, 3])
def test_three_graphs_lie_in_one_another(d):
    points = codewords(d, 12)
    names = ("witnesses", "linear programmes", "Delaunay")
    by_witnesses, inside, everywhere = (edges(GRAPHS[name](points)) for name in names)
    assert edges(witness_graph(points, 20)) < by_witnesses < inside < everywhere
    assert by_witnesses <= edges(witness_graph(points, 65536)) <= inside


def test_the_witness_graph_is_that_of_geometry():
    points = codewords(3, 50)
    theirs = geometry.lookup_neighbours(points, np.zeros(3), np.ones(3), "euclidean")
    assert np.array_equal(witness_graph(points), theirs)
    assert np.array_equal(witness_graph(points, 5000) | theirs, witness_graph(points, 5000))  # beyond one chunk


def test_agreement_by_hand():
    one, other = np.zeros((2, 4, 4), dtype=bool)
    for graph, pairs in ((one, [(0, 1), (1, 2)]), (other, [(0, 1), (0, 2), (0, 3), (1, 3)])):
        for i, j in pairs:
            graph[i, j] = graph[j, i] = True
    assert agreement(one, other) == {"found": 0.25, "right": 0.5}
    assert agreement(other, other) == {"found": 1.0, "right": 1.0}


def test_codewords_are_always_the_same():
    assert np.array_equal(codewords(3, 10), codewords(3, 10)) and codewords(3, 10).shape == (10, 3)
    assert codewords(3, 10).min() >= 0 and codewords(3, 10).max() <= 1


def test_seconds_are_the_least_and_the_work_is_done():
    calls = []

    def work():
        until = time.process_time() + (0.03 if not calls else 0.01)
        while time.process_time() < until:
            pass
        calls.append(1)
        return len(calls)

    taken, result = lookup.seconds(work, total=0.045)
    assert 0.01 <= taken < 0.03 and result == len(calls) >= 3
    assert lookup.seconds(work, total=0.0)[1] == len(calls)  # once at least


# The measurement


def test_everything_is_measured_and_counts_are_whole_numbers(monkeypatch):
    monkeypatch.setattr(lookup, "look_ups", lambda *a: pd.DataFrame({"what": ["look-up"], "seconds": [0.5]}))
    monkeypatch.setattr(lookup, "graphs", lambda *a: pd.DataFrame({"what": ["agreement"], "witnesses": [65536.0]}))
    text = lookup.study().to_csv(index=False, float_format="%.4g")
    assert text.splitlines()[0] == "what,seconds,witnesses,machine,settings,version" and "\nagreement,,65536," in text


def test_look_ups_have_a_row_per_method_dimension_and_size():
    frame = lookup.look_ups((2, 3), (4, 6), total=0.0)
    assert len(frame) == len(frame.drop_duplicates(["method", "metric", "d", "k"])) == 2 * 2 * len(LOOKUPS)
    assert (frame["seconds"] > 0).all()


def test_a_column_is_given_up_where_it_takes_too_long():
    made = lookup.column("Delaunay", 9, (5, 60), limit=1.0)  # in nine dimensions, sixty points take far longer
    assert list(made) == [5]
    taken, graph = made[5]
    assert taken > 0 and np.array_equal(graph, ~np.eye(5, dtype=bool))


def test_graphs_have_a_row_where_they_were_given_up_and_are_compared_where_not(monkeypatch):
    def made(method, d, sizes, *, limit):
        done = sizes if method == "witnesses" else sizes[:1]
        return {k: (0.5, GRAPHS[method](codewords(d, k))) for k in done}

    monkeypatch.setattr(lookup, "column", made)
    frame = lookup.graphs((2,), (5, 20), witnesses=(64, 256))
    own = frame[frame["what"] == "graph"].set_index(["method", "k"])
    assert own["seconds"].isna().sum() == 2 and np.isnan(own.at[("Delaunay", 20), "neighbours"])
    assert own.at[("Delaunay", 5), "neighbours"] == 2 * len(edges(geometry.delaunay_neighbours(codewords(2, 5)))) / 5
    compared = frame[frame["what"] == "agreement"]
    assert (compared["k"] == 5).all() and len(compared) == 2 * 2 + 1
    witnesses = compared[compared["method"] == "witnesses"]
    assert (witnesses["right"] == 1).all() and witnesses["found"].between(0.2, 1).all()
    (exact,) = compared[compared["method"] == "Delaunay"].itertuples()
    assert (exact.reference, exact.found) == ("linear programmes", 1.0)


def test_the_committed_measurement_is_whole():
    frame = results.read_results("lookup")
    cases = len(lookup.DIMENSIONS) * len(SIZES)
    assert (frame["what"] == "look-up").sum() == cases * len(LOOKUPS)
    assert (frame["what"] == "graph").sum() == cases * len(GRAPHS) and frame["machine"].nunique() == 1
    witnesses = frame[(frame["what"] == "agreement") & (frame["method"] == "witnesses")]
    assert (witnesses["right"] == 1).all()  # a witness never lies
    more = witnesses.sort_values("witnesses").groupby(["reference", "d", "k"])["found"]
    assert more.apply(lambda found: found.is_monotonic_increasing).all()


def test_the_command_writes_what_was_measured(tmp_path, monkeypatch):
    frame = pd.DataFrame({"what": ["look-up"], "d": [2], "seconds": [0.123456], "machine": ["some"]})
    monkeypatch.setattr(lookup, "study", lambda: frame)
    monkeypatch.setattr("sys.argv", ["lookup", "--out", str(tmp_path)])
    lookup.main()
    assert (tmp_path / "data/beyond/lookup.csv").read_text() == "what,d,seconds,machine\nlook-up,2,0.1235,some\n"
