"""Explanations in addition to the equations: rules over the inputs."""

from .rules import RulePolicy, describe_rules, find_rules
