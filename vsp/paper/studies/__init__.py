"""Studies of the reproduction: what each open question of the paper changes, and how much belongs to the teacher."""

from .interpretations import PANELS, as_intervals, interpretation_summary, ranking
from .teachers import teacher_summary, variance_shares
