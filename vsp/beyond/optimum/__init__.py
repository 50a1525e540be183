"""The best that any policy can return, computed from the dynamics: what teachers and policies are measured against."""

from .limit import at_the_limit, limit_preset
from .losses import losses
from .references import TASKS, best_policy
from .simplegoal import best_returns
