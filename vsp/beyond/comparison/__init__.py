"""The comparison of methods: how each row is made, and what the committed rows say."""

from ...paper.results import RESULTS, read_results
from .fair_summary import all_rows, budgets, episodes, equal_budget, fit_and_geometry, leaders, possible, tail
from .faithful_summary import largest_alike, likeness, other_teachers
from .limit_summary import limit_summary, near, references, starts_summary, walking
from .method_summary import AS_GOOD, ablation, headline, method_summary, read_rows, rivals, seeds_as_good
from .method_tables import TASKS
from .regret import best_mean, with_regret


def stale_results() -> list[str]:
    """Which committed results were made with other settings, teachers or versions than today's, in words."""
    from .stale import stale  # here, for `python -m` runs a module that nobody has imported

    return stale()
