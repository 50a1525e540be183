"""Studies of the reproduction: the effect of each choice that the paper leaves open, and of the teacher."""

from .interpretations import PANELS, as_intervals, interpretation_summary, ranking
from .teachers import teacher_summary, variance_shares
