"""Certificates: sealed JSON files, and who checks which."""

from __future__ import annotations

import hashlib
import json

from . import mountaincar, pendulum, simplegoal
from .refused import Refused

CHECKS = {"SimpleGoal-v0": simplegoal, "MountainCarContinuous-v0": mountaincar, "Pendulum-v1": pendulum}


def check(path) -> dict:
    """The claim of the certificate in `path`. Raises `Refused` where it is not proved."""
    with open(path, "rb") as file:
        seal, _, payload = file.read().partition(b"\n")
    if hashlib.sha256(payload).hexdigest().encode() != seal:
        raise Refused(f"{path}: the checksum in its first line is not that of the rest")
    return check_content(json.loads(payload))


def check_content(content: dict) -> dict:
    """The claim of a certificate that was read. Raises `Refused`."""
    if content["task"] not in CHECKS:
        raise Refused(f"the task is {content['task']!r}, expected one of {sorted(CHECKS)}")
    return CHECKS[content["task"]].check_content(content)
