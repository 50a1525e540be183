"""Benchmarks: how look-ups and neighbour graphs scale with dimensions and cells; what faults cost (docs/trust.md)."""

from .lookup import LIMIT
