"""Studies of the reproduction: the effect of open choices, of the teacher, and of the cells beside simpler policies."""

from .committed import stale
from .interpretations import PANELS, as_intervals, interpretation_summary, ranking
from .teachers import teacher_summary, variance_shares
