"""The comparison of methods: how each row is made, and what the committed rows show."""

from studies.results import RESULTS, read_results

from .fair_summary import all_rows, budgets, episodes, equal_budget, fit_and_geometry, leaders, possible, tail
from .faithful_summary import largest_alike, likeness, other_teachers
from .limit_summary import limit_summary, near, references, robots_summary, starts_summary
from .method_summary import AS_GOOD, ablation, headline, method_summary, read_rows, rivals, seeds_as_good
from .method_tables import TASKS
from .regret import best_mean, with_regret


def stale_results() -> list[str]:
    """List the committed results made with other settings, teachers or versions than today's, one message each."""
    from .stale import stale  # imported here: `python -m` warns if the module it runs is already imported

    return stale()
