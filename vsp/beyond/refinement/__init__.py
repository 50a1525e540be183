"""Our own methods. `refine` optimises a few cells and their maps for the return. `distill_faithfully` optimises them
for actions like the teacher's as well, `imitate` for these actions alone. `simplify` reduces cells and numbers.

`refine` and `imitate` are also names of modules here, so import the functions from these modules.
"""

from .config import Faithful, Refinement, faithful_preset, tuned_preset
from .simplification import gathered, simplify
