"""Studies of the reproduction: the effect of open choices, of the teacher, and of the cells beside simpler policies."""

from .interpretations import LABELS, shown_variants
from .teachers import teacher_summary
