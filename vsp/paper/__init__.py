"""The reproduction of the paper: its printed values, the rerun and its tables, the ledger, the audit, the studies."""

from ..protocol.intervals import interval
from ..protocol.job import EVALUATION_SEED, N_EPISODES
from . import baselines
from .audit import audit_findings, audit_table, mean_inside
from .ledger import N_RESAMPLES, ledger_gaps, ledger_table, verdict_counts, wrong_verdicts
from .printed import (
    SHORT,
    SUBJECTS,
    TASKS,
    printed_spread_values,
    printed_tdavq_comparison,
    printed_value,
    published_policy,
)
from .results import read_results
from .runs import paper_results
from .statistics import quartiles_from_fences, spread
from .tables import (
    equation_table,
    hyperparameter_table,
    interpretation_table,
    run_overview,
    save_table,
    show_policy,
    show_table,
    spread_table,
    teacher_beside_runs,
    text_number_table,
    write_summary,
)
