"""Read certificates, which are sealed JSON files, and call the checker of their task."""

from __future__ import annotations

import hashlib
import json
import math

from . import mountaincar, pendulum, simplegoal
from .refused import Refused

CHECKS = {"SimpleGoal-v0": simplegoal, "MountainCarContinuous-v0": mountaincar, "Pendulum-v1": pendulum}


def check(path) -> dict:
    """Return the claim of the certificate in `path`. Raises `Refused` if it is not proved."""
    return check_content(read(path))


def read(path) -> dict:
    """Return the content of the certificate in `path`. Raises `Refused` if it is damaged."""
    with open(path, "rb") as file:
        seal, _, payload = file.read().partition(b"\n")
    if hashlib.sha256(payload).hexdigest().encode() != seal:
        raise Refused(f"{path}: the checksum in its first line is not that of the rest")
    try:
        return json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise Refused(f"{path}: no certificate: {error!r:.300}") from error


def check_content(content: dict) -> dict:
    """Return the claim of a certificate that was read. Raises `Refused` if it is not proved."""
    task = content.get("task") if isinstance(content, dict) else None
    if not isinstance(task, str) or task not in CHECKS:
        raise Refused(f"the task is {task!r:.60}, expected one of {sorted(CHECKS)}")
    try:
        check_numbers(**content["policy"])
        return CHECKS[task].check_content(content)
    except (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RecursionError) as error:
        raise Refused(f"the certificate is malformed: {error!r:.300}") from error


def check_numbers(codewords: list, coefficients: list, scale: list, metric: str) -> None:
    """Raise `Refused` for numbers that are not finite, scales that are not positive, or a codeword without a map."""
    if len(codewords) != len(coefficients):
        raise Refused(f"the policy has {len(codewords)} codewords, but {len(coefficients)} maps")
    numbers = [*scale, *(number for codeword in codewords for number in codeword)]
    numbers += [number for rows in coefficients for row in rows for number in row]
    if not all(map(math.isfinite, numbers)) or min(scale) <= 0:
        raise Refused("the policy has numbers that are not finite, or a scale that is not positive")
