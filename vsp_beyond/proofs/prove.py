"""`prove`: prove what a policy of linear maps does from every start of its task."""

from __future__ import annotations

from vsp.policy import VoronoiPolicy

from .mountaincar import prove_mountaincar
from .pendulum import prove_pendulum
from .proof import Proof
from .simplegoal_proof import prove_simplegoal

PROVERS = {
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
    if not isinstance(policy, VoronoiPolicy):
        raise ValueError(f"the policy is {policy!r}, expected a VoronoiPolicy: others have no cells to follow")
    if policy.task.name not in PROVERS:
        needs = "other tasks need a bound on where a step leads from a set of states"
        raise ValueError(f"the policy is for {policy.task.name}, expected one of {sorted(PROVERS)}: {needs}")
    return PROVERS[policy.task.name](policy)
