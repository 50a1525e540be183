"""Our own methods: few cells that act like their teacher, or return much.

`faithful.py` fits a few cells to the teacher's actions and return, `tuned.py` to the return alone, `limit.py` does so
from the best policy. `simplification.py` reduces cells and numbers. The others hold what these share.
"""

from .config import Faithful, Tuned, faithful_preset, tuned_preset
from .limit import limit_preset
from .simplification import gathered, simplify
