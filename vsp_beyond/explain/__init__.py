"""Explanations in addition to the equations: rules over the inputs, and figures of one state's explanation."""

from .rules import RulePolicy, describe_rules, find_rules
