"""All findings, in the order in which they are shown."""

from __future__ import annotations

from functools import partial

import pandas as pd

from .. import printed
from . import policies, protocol, returns
from .finding import Finding

_SIMPLEGOAL, _MOUNTAINCAR = printed.TASKS
_CHECKS = (
    protocol.run_counts, returns.simplegoal_coverage, returns.other_columns, returns.mountaincar_quartiles,
    returns.outlier_rules, returns.teacher_outliers, returns.outlier_moments, returns.printed_twice,
    returns.return_limits, returns.simplegoal_wording, policies.printed_digits, policies.simplegoal_rows,
    policies.mountaincar_colours, partial(policies.close_pairs, _SIMPLEGOAL, "T3"),
    partial(policies.close_pairs, _MOUNTAINCAR, "T4"), policies.outputs_beyond_limits, policies.dimensions,
    protocol.truncation, protocol.thousands, protocol.frozen_iterations,
)  # fmt: skip


def audit_findings() -> list[Finding]:
    """Compute all findings."""
    return [check() for check in _CHECKS]


def in_doubt() -> set[str]:
    """Return the ids of the printed values that a contradiction puts in doubt."""
    return {id for finding in audit_findings() for id in finding.concerns}


def audit_table(findings: list[Finding]) -> pd.DataFrame:
    """Return one row per finding: number, finding, printed, arithmetic, verdict."""
    rows = [(i, f.title, f.printed, f.arithmetic, f.verdict) for i, f in enumerate(findings, start=1)]
    return pd.DataFrame(rows, columns=["number", "finding", "printed", "arithmetic", "verdict"])
