"""Check certificates without the prover: these files share no code with it. For MountainCar, whose proof is a run from
all states, the check is only a sample.

python -m vsp_beyond.proofs.check FILE ...
"""

from . import mountaincar, pendulum, simplegoal
from .certificates import check, check_content
from .refused import Refused

__all__ = ["Refused", "check", "check_content", "mountaincar", "pendulum", "simplegoal"]
