"""Prove properties of policies with a few linear maps: follow all starts at once instead of sampling some.

`prove` follows SimpleGoal's starts in exact arithmetic, runs MountainCar's program from every state that it can reach,
and finds the starts from which Pendulum surely gets upright. Every proof writes a certificate, which the separate
program in `check/` verifies. `steps_to_goal` proves over a grid what holds for SimpleGoal also on borders, under
rounding, and under disturbances. `teacher_steps_to_goal` does the same for the teacher. `at_rest` finds starts of
MountainCar from which the car never moves.
"""

from .dead_points import at_rest
from .network import teacher_steps_to_goal
from .proof import Proof, load_certificate
from .prove import prove
from .robust import largest_disturbance, proved, steps_to_goal
