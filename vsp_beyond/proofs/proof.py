"""The base class of all proofs: each writes a certificate, which `vsp_beyond.proofs.check` verifies without the
prover's code."""

from __future__ import annotations

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from fractions import Fraction

from vsp.checks import check_choice
from vsp.policy import VoronoiPolicy
from vsp.run import atomic, sealed
from vsp.tasks import Task

RESULTS = atomic.ROOT / "data" / "beyond"
CERTIFICATES = RESULTS / "proofs"
METRICS = ("euclidean", "manhattan")


def check_provable(policy: VoronoiPolicy, task: Task, metrics: Collection[str] = METRICS) -> None:
    """Raise ValueError unless `policy` is a `VoronoiPolicy` of linear maps for `task`, with one of the `metrics`."""
    if not isinstance(policy, VoronoiPolicy) or policy.task.name != task.name:
        raise ValueError(f"the policy is {policy!r}, expected a VoronoiPolicy for {task.name}")
    check_choice("the policy's metric", policy.metric, metrics)
    policy.check_linear()


@dataclass(frozen=True)
class Proof(ABC):
    """A proved claim about a policy."""

    policy: VoronoiPolicy

    @property
    @abstractmethod
    def claim(self) -> dict:
        """The proved claim, as JSON-serialisable values."""

    @abstractmethod
    def parts(self) -> list:
        """Return the parts of the proof, as JSON-serialisable values."""

    def __str__(self) -> str:
        """Say the claim in one line."""
        numbers = (f"{name.replace('_', ' ')} {float(Fraction(value)):.6g}" for name, value in self.claim.items())
        return f"{self.policy.task.name}, cells: {len(self.policy)}, proved: {', '.join(numbers)}"

    def certificate(self) -> dict:
        """Return task, policy, claim and pieces, as JSON-serialisable values."""
        numbers = {name: getattr(self.policy, name).tolist() for name in ("codewords", "coefficients", "scale")}
        return {
            "task": self.policy.task.name,
            "policy": {**numbers, "metric": self.policy.metric},
            "claim": self.claim,
            "pieces": self.parts(),
        }

    def save(self, path: str | os.PathLike) -> None:
        """Write the certificate to one sealed file."""
        sealed.write_sealed(path, json.dumps(self.certificate(), separators=(",", ":"), sort_keys=True).encode())


def load_certificate(name: str) -> tuple[VoronoiPolicy, dict]:
    """Load the certificate data/beyond/proofs/NAME.json: return its policy and its content. Raises `DamagedFile`."""
    content = json.loads(sealed.read_sealed(CERTIFICATES / f"{name}.json"))
    return VoronoiPolicy(**content["policy"], task=content["task"]), content
