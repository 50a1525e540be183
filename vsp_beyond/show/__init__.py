"""Figures of what goes beyond the paper."""

from .explanation import contributions, whereabouts
from .proofs import basins, upright
