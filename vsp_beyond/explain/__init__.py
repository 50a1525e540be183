"""Explanations in addition to the equations: rules over the inputs, and LIME for comparison."""

from .lime import compare_maps
from .rules import RulePolicy, describe_rules, find_rules
