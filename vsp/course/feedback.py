"""What a check says: one line on what was found and what was expected, in kind, or one line that all is well.

A check never tells the answer: it calls what a student wrote on small cases, tries whether the result is what a common
mistake would give, and points to a hint.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import textwrap
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

WIDTH = 90  # characters of a message's lines


class NotYet(AssertionError):
    """An answer that is missing or not right yet. Jupyter shows its message and no traceback."""

    def _render_traceback_(self) -> list[str]:
        return _lines(f"✗ {self}")


@dataclass(frozen=True)
class Mistake:
    """What a common mistake makes of a case, and what to say about it."""

    result: object  # numbers, compared with what the student's function returned
    found: str
    expected: str
    hint: int | None = None


@dataclass(frozen=True)
class Exercise:
    """One exercise: its number, and the name of what the student writes."""

    number: str
    name: str

    def wrong(self, found: str, expected: str, hint: int | None = None) -> NotYet:
        """The exception to raise for an answer that is not right; `hint` is the number of the hint that helps."""
        found = " ".join(found.split())  # an error's own words may have many lines
        return NotYet(f"{self.number} {self.name}: found {found}, expected {expected}.{self._pointer(hint)}")

    def _pointer(self, hint: int | None) -> str:
        return f" → Hint {hint} of exercise {self.number}" if hint else ""

    def unsolved(self) -> NotYet:
        """The exception to raise where the student has not begun."""
        todo = "put your own code in place of the stub, run that cell, then this one"
        return NotYet(f"{self.number} {self.name} is not written yet: {todo}.")

    def checks(self, check: Callable) -> Callable:
        """Decorator of the exercise's check: what the check cannot read it says in words, like all else."""

        @functools.wraps(check)
        def careful(*answer: object, **settings: object) -> None:
            try:
                check(*answer, **settings)
            except NotYet:
                raise
            except Exception as error:
                found = f"something that cannot be read ({type(error).__name__}: {error})"
                raise self.wrong(found, "an answer as the text describes it") from None

        return careful

    def passed(self, text: str) -> None:
        """Say that all is well."""
        print(*_lines(f"✓ {self.number} {self.name}: {text}"), sep="\n")

    def call(self, function: Callable, *arguments: object, keep: bool = False) -> object:
        """What `function` returns for copies of `arguments`, or for these themselves if it is to alter them (`keep`).

        Raises NotYet for a stub, an error, or no result.
        """
        if not callable(function):
            raise self.wrong(f"{function!r}", "a function")
        try:
            result = function(*(arguments if keep else copy.deepcopy(arguments)))
        except NotImplementedError:
            raise self.unsolved() from None
        except Exception as error:
            found = f"{type(error).__name__} ({error}) {_place(function, error)}"
            raise self.wrong(found, "a result: print what that line works with") from None
        if result is None:
            raise self.wrong("None as the result", "something after `return`")
        return result

    def array(
        self, value: object, shape: tuple[int, ...], what: str = "a result", hint: int | None = None, meaning: str = ""
    ) -> np.ndarray:
        """`value` as an array of floats. Raises NotYet unless its shape is `shape` and all are finite; `meaning` says
        what an array of that shape is to hold."""
        try:
            values = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            shown = " ".join(repr(value).split())[:40]
            raise self.wrong(
                f"{what} that is not made of numbers, {shown}", f"numbers of shape {shape}", hint
            ) from None
        if values.shape != shape:
            raise self.wrong(f"{what} of shape {values.shape}", f"{shape}{': ' if meaning else ''}{meaning}", hint)
        if not np.isfinite(values).all():
            raise self.wrong(f"NaN or infinity in {what}", "finite numbers", hint)
        return values

    def size(self, value: object) -> int:
        """How many entries `value` has. Raises NotYet for what is no collection."""
        if not hasattr(value, "__len__"):
            raise self.wrong(f"{value!r} as the result", "a list")
        return len(value)

    def compare(
        self, value: object, right: object, mistakes: Sequence[Mistake], otherwise: Mistake, rtol: float = 1e-6
    ) -> None:
        """Raise NotYet unless `value` is `right`, with the words of the first mistake that it agrees with."""
        if not _close(value, right, rtol):
            mistake = next((m for m in mistakes if _close(value, m.result, rtol)), otherwise)
            raise self.wrong(mistake.found, mistake.expected, mistake.hint)

    def answers(self, given: object, options: dict[str, Sequence[str] | type]) -> dict:
        """The dictionary `given`, with an answer for every key of `options`. Raises NotYet for what is none of them."""
        if not isinstance(given, dict):
            raise self.wrong(f"{given!r}", "a dictionary of answers")
        for key, choices in options.items():
            answer = given.get(key)
            if answer is None:
                todo = "write your answer in place of None and run that cell, without the stub"
                raise NotYet(f"{self.number} {self.name}: question {key!r} is not answered yet: {todo}.")
            if choices is float:
                if isinstance(answer, bool) or not isinstance(answer, int | float | np.number):
                    raise self.wrong(f"{answer!r} for {key!r}", "a number")
            elif answer not in choices:
                raise self.wrong(f"{answer!r} for {key!r}", f"one of {list(choices)}")
        return given

    def choice(self, given: dict, key: str, right: str, teaching: dict[str, str], hint: int | None = None) -> None:
        """Raise NotYet unless the answer to `key` is `right`; `teaching` says something about wrong ones."""
        if given[key] != right:
            words = teaching.get(given[key], "look again")
            raise NotYet(
                f"{self.number} {self.name}, question {key!r}: not {given[key]!r}: {words}.{self._pointer(hint)}"
            )

    def sealed(self, given: dict, key: str, digest: str, teaching: dict[str, str], hint: int | None = None) -> None:
        """As `choice`, for a right answer of which only the salted digest is known."""
        self.choice(given, key, given[key] if seal(self.number, key, given[key]) == digest else "", teaching, hint)


def seal(number: str, key: str, answer: str) -> str:
    """A salted digest of an answer, which cannot be read."""
    return hashlib.sha256(f"vsp course|{number}|{key}|{answer}".encode()).hexdigest()[:16]


def _place(function: Callable, error: Exception) -> str:
    """The line of the student's cell, that of `function`, where `error` arose: the last that was entered."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"in line {lines[-1].lineno} of its cell, `{lines[-1].line}`" if lines else "when it is called"


def _lines(text: str) -> list[str]:
    """`text` in lines that a notebook need not break."""
    return textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _close(value: object, right: object, rtol: float) -> bool:
    value, right = np.asarray(value, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return value.shape == right.shape and np.allclose(value, right, rtol=rtol, atol=1e-9)
