"""What can be known for certain of a few linear maps: not sampled, but followed from all starts at once.

`prove` follows SimpleGoal's starts in exact arithmetic, runs MountainCar's program from every state that it can reach,
and finds from where Pendulum surely gets upright. Every proof writes a certificate, which `check/`, a program of its
own, verifies. `steps_to_goal` proves over a grid what holds of SimpleGoal on borders, under rounding, and under
disturbances too; `teacher_steps_to_goal` asks the same of a network. `at_rest` looks for starts of MountainCar from
which the car never moves.
"""

from .dead_points import at_rest
from .network import teacher_steps_to_goal
from .proof import Proof, load_certificate
from .prove import prove
from .robust import largest_disturbance, proved, steps_to_goal
