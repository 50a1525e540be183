"""Benchmarks: how look-ups and neighbour graphs grow with dimensions and cells; what faults cost (docs/trust.md)."""

from .lookup import LIMIT
