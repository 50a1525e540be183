"""Sub-policies: the classes of local model by name, and those of all cells stacked in one array.

To add a class, write a function of the task that returns its `PolicyClass`, and enter it in `registry`.
"""

from .base import PolicyClass, linear_outputs
from .registry import POLICY_CLASSES, policy_class
from .stacked import SubPolicies
