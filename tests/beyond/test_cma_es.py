import numpy as np

from vsp_beyond.few_cells.tune import cma_es


def test_a_short_search_of_many_numbers_gains_by_learning_variances_only():
    scales, found = np.logspace(0, 2, 200), {}
    for diagonal in (True, False):
        search = cma_es(np.ones(200), 0.3, np.random.default_rng(0), diagonal=diagonal)
        for _ in range(100):
            steps = search.ask()
            search.tell(steps, [float(np.square(scales * step).sum()) for step in steps])
        found[diagonal] = search.result.fbest
    assert found[True] < 0.95 * found[False]
