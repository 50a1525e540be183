"""The comparison of methods: how each row is made, and what the committed rows show."""

from ..committed import RESULTS, read_results
from .equal_tuning import all_rows, budgets, closest, equal_budget, fit_and_geometry, leaders, possible
from .limits import best_mean, limit_summary, near, references, robots_summary, starts_summary, with_regret
from .methods import TASKS
from .summary import ablation, largest_alike, likeness, method_summary, other_teachers, read_rows
