"""Sub-policies: the classes of local models by name, and the sub-policies of all cells in one array.

To add a class, write a function that takes a task and returns a `PolicyClass`, and enter it in `linear.POLICY_CLASSES`.
"""

from .base import PolicyClass, linear_outputs
from .linear import POLICY_CLASSES, SubPolicy, policy_class
from .stacked import SubPolicies
