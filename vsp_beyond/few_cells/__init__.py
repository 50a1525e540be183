"""Our own methods: few cells that act like their teacher, or return much.

`faithful.py` fits a few cells to the teacher's actions and return, `tuned.py` to the return alone, `limit.py` does so
from the best policy. `simplification.py` reduces cells and numbers.

They share, from the ground up: `units.py`, cells and labelled states as arrays; `search.py`, which fits the ones to
the others; `tune.py`, which plays candidates and raises their return.
"""

from .config import Faithful, Tuned, faithful_preset, tuned_preset
from .limit import limit_preset
from .simplification import gathered, simplify
