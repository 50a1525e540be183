"""What can be known for certain of a few linear maps: not sampled, but followed from all starts at once.

`prove` follows SimpleGoal's starts in exact arithmetic. It writes certificates, which a program of its own checks.
`steps_to_goal` proves over a grid what holds on borders, under rounding, and under disturbances too.
`at_rest` looks for starts of MountainCar from which the car never moves.
"""

from .dead_points import at_rest
from .proof import Proof, prove
from .robust import largest_disturbance, proved, steps_to_goal
