"""Our own methods: few cells that act like their teacher, or return much.

`distill_tuned` optimises a few cells and their coefficients for the return, `search_limit` does so from the best
policy. `distill_faithfully` optimises them for actions like the teacher's too. `simplify` reduces cells and numbers.
"""

from .config import Faithful, Tuned, faithful_preset, tuned_preset
from .limit import limit_preset
from .simplification import gathered, simplify
