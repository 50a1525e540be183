"""Benchmark up to how many dimensions kd-trees and Delaunay triangulations pay off, and what replaces them beyond.

The paper names both as limits in many dimensions. Codewords are uniform in the unit cube, which is equally hard for all
methods. Distances are Euclidean, for which the Delaunay graph is exact; look-ups are also measured for the Manhattan
distance. The command writes data/results/lookup.csv. Times are processor time of one thread. Times, and which graphs
exceed the time limit, differ from run to run. All other columns are the same on every machine.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from vsp import geometry
from vsp.paper.results import settings_id, write_results
from vsp.run import kernels
from vsp.run.progress import progress

VERSION = 1  # raise it when the methods or the way of measuring change
DIMENSIONS = (2, 3, 4, 6, 8, 11, 17)  # 8, 11 and 17 are those of LunarLander, Hopper and HalfCheetah
SIZES = (10, 30, 100, 300, 1000)  # codewords
N_STATES = 1000  # looked up at once, as in an evaluation of 1000 episodes
WITNESSES = (256, 1024, 4096, 16384, 65536)
LIMIT = 6.0  # seconds of wall time that a graph may take; Qhull allocates some 50 MB per second
METRIC = "euclidean"
_CHUNK = 4096  # witnesses per chunk: their distances are in memory at once


# Look-ups: the index of the nearest codeword (k, d) of each state (n, d)


def nearest_by_product(codewords: np.ndarray, states: np.ndarray, metric: str = METRIC) -> np.ndarray:
    """Find the nearest codewords by one matrix product. Euclidean distance only.

    Uses |s - c|^2 = |s|^2 + |c|^2 - 2 s.c, where |s|^2 is the same for all codewords.
    """
    gaps = states @ (-2 * codewords.T)
    gaps += np.square(codewords).sum(axis=1)  # in place, because memory is slower than arithmetic
    return gaps.argmin(axis=1)


LOOKUPS = {
    ("cdist", "euclidean"): partial(geometry.nearest, kdtree=False),
    ("cdist", "manhattan"): partial(geometry.nearest, kdtree=False),
    ("matrix product", "euclidean"): nearest_by_product,
    ("kd-tree", "euclidean"): partial(geometry.nearest, kdtree=True),
    ("kd-tree", "manhattan"): partial(geometry.nearest, kdtree=True),
}


# Graphs: which of the codewords (k, d) in the unit cube are neighbours, (k, k) bool


def witness_graph(codewords: np.ndarray, n: int = geometry.WITNESSES) -> np.ndarray:
    """Return the graph of `geometry.lookup_neighbours` in the unit cube, with n witnesses."""
    from scipy.stats import qmc

    k, d = codewords.shape
    graph = np.zeros((k, k), dtype=bool)
    points = qmc.Halton(d, scramble=False).random(n)
    for part in np.array_split(points, -(-n // _CHUNK)):
        graph |= geometry.visited_neighbours(codewords, part, METRIC)
    return graph


def touching(codewords: np.ndarray) -> np.ndarray:
    """Compute exactly which Euclidean cells touch inside the unit cube, by one linear programme per pair.

    Cells i and j touch if some point of the cube is as near to i as to j and not nearer to any other codeword. Being
    nearer is a linear inequality. The time grows as k^3 and hardly depends on d.
    """
    from scipy.optimize import linprog

    k, d = codewords.shape
    graph, squares = np.zeros((k, k), dtype=bool), np.square(codewords).sum(axis=1)
    for i in range(k):
        sides, limits = 2 * (codewords - codewords[i]), squares - squares[i]  # sides @ x <= limits: i is no farther
        for j in range(i):
            others = np.arange(k)[(np.arange(k) != i) & (np.arange(k) != j)]
            found = linprog(np.zeros(d), sides[others], limits[others], sides[[j]], limits[[j]], bounds=(0, 1))
            graph[i, j] = graph[j, i] = found.status == 0
    return graph


GRAPHS = {"Delaunay": geometry.delaunay_neighbours, "linear programmes": touching, "witnesses": witness_graph}


# Measuring


def codewords(d: int, k: int) -> np.ndarray:
    """Return the codewords (k, d) that all measurements use."""
    return np.random.default_rng([d, k]).random((k, d))


def seconds(work: Callable[[], object], *, total: float = 0.1) -> tuple[float, object]:
    """Return the minimum processor time of `work` over calls that together take `total` seconds, and its result."""
    times = []
    while not times or sum(times) < total:
        begin = time.process_time()
        result = work()
        times.append(time.process_time() - begin)
    return min(times), result


def look_ups(dimensions=DIMENSIONS, sizes=SIZES, *, total: float = 0.1) -> pd.DataFrame:
    """Time the look-up of `N_STATES` states, including building the kd-tree, one row per method, metric, d and k.

    Times are in seconds.
    """
    rows = []
    for d in progress(dimensions, "look-ups", total=len(dimensions), unit="dimensions"):
        states = np.random.default_rng(d).random((N_STATES, d))
        for k in sizes:
            points = codewords(d, k)
            for (method, metric), look_up in LOOKUPS.items():
                taken, _ = seconds(partial(look_up, points, states, metric), total=total)
                rows.append({"what": "look-up", "method": method, "metric": metric, "d": d, "k": k, "seconds": taken})
    return pd.DataFrame(rows)


def column(method: str, d: int, sizes=SIZES, *, limit: float = LIMIT) -> dict[int, tuple[float, np.ndarray]]:
    """Return time (s) and graph of a method of `GRAPHS` by number of codewords.

    Stops at the first graph that takes over `limit` seconds. Works in a child process, because Qhull cannot be
    interrupted.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_column, args=(theirs, method, d, sizes), daemon=True)
    child.start()
    theirs.close()
    made = {}
    try:
        ours.recv()  # the imports are done
        for k in sizes:
            if not ours.poll(limit):
                break
            made[k] = ours.recv()
    except EOFError:  # the child ran out of memory
        pass
    finally:
        child.kill()
        child.join()
    return made


def _column(pipe, method: str, d: int, sizes) -> None:
    """Do the work of `column` in its child process."""
    GRAPHS[method](codewords(2, 4))  # the first call imports modules
    pipe.send("ready")
    with threadpool_limits(1):
        for k in sizes:
            pipe.send(seconds(lambda k=k: GRAPHS[method](codewords(d, k))))


def graphs(dimensions=DIMENSIONS, sizes=SIZES, *, witnesses=WITNESSES, limit: float = LIMIT) -> pd.DataFrame:
    """Measure times and agreement of neighbour graphs: one row per method, d and k, and per reference if there is one.

    "graph" rows have seconds (NaN if the graph took over `limit` or ran out of memory) and neighbours (the mean per
    codeword). "agreement" rows have reference ("Delaunay", or "linear programmes", the exact graph inside the cube),
    witnesses, neighbours, found (share of the reference's edges that the method has) and right (share of the method's
    edges that the reference has).
    """
    rows = []
    for d in progress(dimensions, "graphs", total=len(dimensions), unit="dimensions"):
        made = {method: column(method, d, sizes, limit=limit) for method in GRAPHS}
        for k in sizes:
            about = {"metric": METRIC, "d": d, "k": k}
            known = {method: own[k][1] for method, own in made.items() if k in own}
            for method, own in made.items():
                taken, degree = (own[k][0], _degree(own[k][1])) if k in own else (np.nan, np.nan)
                rows.append({"what": "graph", "method": method, **about, "seconds": taken, "neighbours": degree})
            rows += [{"what": "agreement", **about, **row} for row in _agreements(known, codewords(d, k), witnesses)]
    return pd.DataFrame(rows)


def _agreements(known: dict[str, np.ndarray], points: np.ndarray, witnesses) -> list[dict]:
    """Return the rows that compare witness graphs with the references among `known`, and references with each other."""
    references = {name: known[name] for name in ("Delaunay", "linear programmes") if name in known}
    compared = [("witnesses", n, witness_graph(points, n)) for n in witnesses] if references else []
    compared += [("Delaunay", np.nan, graph) for name, graph in known.items() if name == "Delaunay"]
    return [
        {"method": method, "witnesses": n, "reference": name, "neighbours": _degree(graph), **agreement(graph, true)}
        for name, true in references.items()
        for method, n, graph in compared
        if method != name
    ]


def agreement(graph: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Compare edges: found (share of the reference's that `graph` has), right (share of its own in the reference)."""
    both = (graph & reference).sum()
    return {"found": float(both / reference.sum()), "right": float(both / graph.sum())}


def _degree(graph: np.ndarray) -> float:
    """Return the mean number of neighbours."""
    return float(graph.sum() / len(graph))


def study(dimensions=DIMENSIONS, sizes=SIZES) -> pd.DataFrame:
    """Run all measurements. Columns that do not apply to a row are NaN."""
    with threadpool_limits(1):
        parts = [look_ups(dimensions, sizes), graphs(dimensions, sizes)]
    frame = pd.concat(parts, ignore_index=True).astype({"witnesses": "Int64"})
    return frame.assign(machine=kernels.name(), **made_with(dimensions, sizes))


def made_with(dimensions=DIMENSIONS, sizes=SIZES) -> dict[str, str | int]:
    """Return what identifies the table: settings (an id) and version."""
    settings = [dimensions, sizes, N_STATES, WITNESSES, LIMIT, METRIC, geometry.WITNESSES]
    return {"settings": settings_id({"lookup": settings}), "version": VERSION}


def main() -> None:
    """Measure look-ups and neighbour graphs, in under three minutes, and write OUT/data/results/lookup.csv."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", default=".", help="the result goes to OUT/data/results")
    write_results(study(), "lookup", out=parser.parse_args().out, float_format="%.4g")


if __name__ == "__main__":
    main()
