"""Prove properties of policies with a few linear maps: follow all starts at once instead of sampling some.

`prove` follows SimpleGoal's starts in exact arithmetic, runs MountainCar's program from every state that it can reach,
and finds the starts from which Pendulum surely gets upright. Every proof writes a certificate, which the separate
program in `check/` verifies. `steps_to_goal` proves over a grid what holds for SimpleGoal also on borders, under
rounding, and under disturbances. `at_rest` finds starts of MountainCar from which the car never moves.
"""

from collections.abc import Callable

from vsp.policy import VoronoiPolicy

from .dead_points import at_rest
from .mountaincar import prove_mountaincar
from .pendulum import prove_pendulum
from .proof import Proof, load_certificate
from .robust import largest_disturbance, proved, steps_to_goal
from .simplegoal_proof import prove_simplegoal

PROVERS: dict[str, Callable[[VoronoiPolicy], Proof]] = {
    "SimpleGoal-v0": prove_simplegoal,
    "MountainCarContinuous-v0": prove_mountaincar,
    "Pendulum-v1": prove_pendulum,
}


def prove(policy: VoronoiPolicy) -> Proof:
    """Prove what `policy` does from every start of its task.

    On SimpleGoal: how every episode ends, exactly (seconds to a minute). On MountainCar: what Gymnasium's program does
    from every start (four minutes on two cores). On Pendulum: from which starts it surely gets upright and stays
    (ten seconds). Raises ValueError for a policy of another task or class: a proof needs a bound on where a step leads.
    """
    if not isinstance(policy, VoronoiPolicy) or policy.task.name not in PROVERS:
        raise ValueError(f"the policy is {policy!r}, expected a VoronoiPolicy for one of {sorted(PROVERS)}")
    return PROVERS[policy.task.name](policy)
