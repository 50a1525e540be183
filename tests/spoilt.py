"""Arguments that a function cannot work with, and the check that it refuses each of them by an error of ours."""

import math
import traceback
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from support import SIMPLEGOAL, Constant

from vsp.policy import VoronoiPolicy
from vsp.run.atomic import ROOT

# What good calls are made of: numbers that float32 holds exactly
STATES = np.array([(x, y) for x in (0.125, 0.375, 0.625, 0.875) for y in (0.25, 0.5, 0.75)])  # (12, 2)
TWO = VoronoiPolicy([[0.0, 0.5], [1.0, 0.5]], [[[1, 0], [0, 2], [0.25, -0.5]], np.zeros((3, 2))], task=SIMPLEGOAL)
NOWHERE = (np.nan, np.inf, -np.inf)


@dataclass(frozen=True)
class Argument:
    """A value that is good, and some that are not."""

    good: object
    bad: list


def but_for_none(argument):
    """The argument where None is good as well."""
    return Argument(argument.good, [value for value in argument.bad if value is not None])


def array(good, *, free=(0,), nonempty=False, any_shape=False, also=()):
    """An array of numbers: the axes in `free` may be of any length; if `nonempty`, an array without rows is bad."""
    good = np.asarray(good, dtype=np.float64)
    bad = [None, "1.5", {}, [[1.0], [1.0, 2.0]], *also, *map(good.astype, (bool, object, str, complex, "M8[s]"))]
    for i in range(good.size):
        bad.append(good.copy())
        bad[-1].flat[i] = NOWHERE[i % 3]
    shapes = [] if any_shape else [(1, *good.shape), ()]
    for axis in () if any_shape else set(range(good.ndim)) - set(free):
        lengths = 0, good.shape[axis] - 1, good.shape[axis] + 1
        shapes += [good.shape[:axis] + (n,) + good.shape[axis + 1 :] for n in lengths]
    shapes += [(0, *good.shape[1:])] if nonempty else []
    return Argument(good, bad + [np.resize(good, shape) for shape in shapes])


def count(good, *, least=1, most=None):
    """A whole number."""
    beyond = [least - 1, -(10**9)] + ([] if most is None else [most + 1])
    return Argument(good, [*beyond, good + 0.5, float(good), *NOWHERE, None, str(good), True, [good], 1j])


def number(good, *, least=-math.inf, most=math.inf):
    """A finite number in a range."""
    outside = [value for value in (least - 1, least - 1e-9, most + 1e-9, most + 1) if math.isfinite(value)]
    return Argument(good, [*outside, *NOWHERE, None, "1", True, [1.0], 1j])


def name(good):
    """A name among some that are known."""
    return Argument(good, ["", "x", good + " ", good.upper() + "!", None, 3, [good], np.nan, {}])


def actor(good, m=2):
    """A policy for a task with m actions."""
    values, answers = [np.nan, np.inf, "up", 1j, True, None], [None, 3.0, (), np.zeros(m)]
    bad = [Constant(*[value] * m) for value in values] + [Constant(*[0.0] * n) for n in (0, m - 1, m + 1)]
    bad += [SimpleNamespace(predict=lambda obs, answer=answer: answer) for answer in answers]
    return Argument(good, [*bad, None, 3, "TD3", np.zeros(2)])


def settings(good, *, from_zero=(), any_sign=()):
    """The fields of a dataclass of settings: positive but for those `from_zero` on, and for those of `any_sign`."""
    fields = {}
    for field, hint in get_type_hints(type(good)).items():
        value, optional = getattr(good, field), type(None) in get_args(hint)
        if get_origin(hint) is Literal:
            fields[field] = name(value)
        elif hint is bool:
            fields[field] = Argument(value, [0, 1, None, "True", np.nan, np.bool_(True), []])
        elif hint is int:
            fields[field] = count(value, least=0 if field in from_zero else 1)
        elif value is not None:
            argument = number(value, least=-math.inf if field in any_sign else 0.0)
            fields[field] = but_for_none(argument) if optional else argument
    return fields


def refuses(function, arguments):
    """Call `function` with good arguments, then with each of them spoilt in every way: it must raise an error of ours.

    Without the first call, the others might be refused for another reason than the one that they are about.
    """
    good = {argument: value.good for argument, value in arguments.items()}
    function(**good)
    for argument, value in arguments.items():
        for bad in value.bad:
            print(f"{argument} = {bad!r}")  # which pytest shows of a test that fails
            with pytest.raises(
                (ValueError, TypeError, FileNotFoundError), match="expected|fails on|lies outside|name the task|load it"
            ) as caught:
                function(**good | {argument: bad})
            raised_in = Path(traceback.extract_tb(caught.tb)[-1].filename).relative_to(ROOT)
            assert raised_in.parts[0].startswith("vsp"), f"not an error of ours, but of {raised_in}"
