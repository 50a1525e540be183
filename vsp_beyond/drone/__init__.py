"""A quadrotor that hovers: its task, the network that flew, and linear maps that fly as a network does."""

from .flown import Flown
from .imitation import few_maps
