"""Checks certificates, and shares no code with the prover: who trusts these files need not trust the others. Only of
MountainCar, whose proof is a run of all states, a check is a sample.

python -m vsp.beyond.proofs.check FILE ...
"""

from . import mountaincar, pendulum, simplegoal
from .certificates import check, check_content
from .refused import Refused

__all__ = ["Refused", "check", "check_content", "mountaincar", "pendulum", "simplegoal"]
