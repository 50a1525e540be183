"""A quadrotor that hovers: its task, the network that flew, and one linear map that flies as a network does."""

from .flown import Flown
from .imitation import one_map
