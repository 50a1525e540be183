"""Our own method: `refine` optimises a few cells and their maps together, `simplify` reduces cells and numbers.

`imitate` fits the teacher's actions alone. `refine` and `imitate` are also modules here, so import the functions from
these, or `vsp.refine`.
"""

from .config import Refinement, best_preset
from .simplification import gathered, simplify
