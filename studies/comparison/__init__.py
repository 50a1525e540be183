"""The comparison of methods: how each row is made, and what the committed rows show."""

from ..committed import RESULTS, read_results
from .equal_tuning import all_rows, budgets, closest, equal_budget, fit_and_geometry, leaders, possible
from .methods import TASKS
from .summary import (
    ablation,
    best_mean,
    largest_alike,
    likeness,
    limit_summary,
    method_summary,
    near,
    other_teachers,
    read_rows,
    references,
    robots_summary,
    starts_summary,
    with_regret,
)
