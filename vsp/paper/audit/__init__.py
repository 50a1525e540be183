"""The audit: do the numbers that the paper prints agree with each other, with its tables, and with its tasks?

Each finding is a function of the transcribed values in `data/paper`; `audit_findings()` runs them all.
Returns have no unit, shares are in percent. Standard deviations divide by n, as NumPy's do; n - 1 makes a difference
only for the 24 outliers of SimpleGoal's teacher. The rounding of the printed values changes no verdict.
"""

from .columns import mean_inside
from .finding import VERDICTS
from .findings import audit_findings, audit_table, in_doubt
