"""Shared by all checks: call a student's function, recognise common mistakes, print one line of feedback.

Feedback names what was found and what was expected, and points to a hint. It never gives the answer.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import inspect
import signal
import sys
import textwrap
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType

import numpy as np

from vsp.rollouts import Episode, Policy

WIDTH = 90  # characters of a message's lines
_FIRST: dict[str, dict] = {}  # the first complete answers to each exercise with questions


class TooLong(BaseException):
    """A check took too long. Not an Exception, so that a student's `except Exception` does not catch it."""


class NotYet(AssertionError):
    """An answer that is missing or wrong. Jupyter shows its message without a traceback."""

    def _render_traceback_(self) -> list[str]:
        return _lines(f"✗ {self}")


@dataclass(frozen=True)
class Mistake:
    """The wrong result of a common mistake, and the feedback for it."""

    result: object  # numbers, compared with what the student's function returned; None: any others
    found: str
    expected: str
    hint: int | None = None


@dataclass(frozen=True)
class Question:
    """A question, its possible answers, and the feedback for wrong ones."""

    options: Sequence[str]
    right: str  # the right answer, or its `seal` where students must not read it
    hint: int
    teaching: dict[str, str] = field(default_factory=dict)


class ActionsAlone:
    """A policy whose `predict` returns the actions alone, as a student may wrongly expect."""

    def __init__(self, policy: Policy):
        self.policy = policy

    def predict(self, obs: np.ndarray) -> np.ndarray:
        """Return the actions alone."""
        return self.policy.predict(obs)[0]


@dataclass(frozen=True)
class Exercise:
    """One exercise: its number, and the name that the student defines."""

    number: str
    name: str
    refused: tuple[str, ...] = ()  # "module.name" of vsp functions that the answer must not call
    seconds: float = 30  # time limit of a check

    def wrong(self, found: str, expected: str, hint: int | None = None) -> NotYet:
        """Return the exception to raise for a wrong answer. `hint` is the number of the hint that helps."""
        found = " ".join(found.split())  # an error's message may have many lines
        return NotYet(f"{self.number} {self.name}: found {found}, expected {expected}.{self._pointer(hint)}")

    def refuse_if(self, wrong: bool, found: str, expected: str, hint: int | None = None) -> None:
        """Raise NotYet if the answer is `wrong`."""
        if wrong:
            raise self.wrong(found, expected, hint)

    def _pointer(self, hint: int | None) -> str:
        return f" → Hint {hint} of exercise {self.number}" if hint else ""

    def unsolved(self) -> NotYet:
        """Return the exception to raise if the answer is still the stub."""
        todo = "put your own code in place of the stub, run that cell, then this one"
        return NotYet(f"{self.number} {self.name} is not written yet: {todo}.")

    def checks(self, check: Callable) -> Callable:
        """Decorate the exercise's check: errors inside it and endless loops become feedback too."""

        @functools.wraps(check)
        def careful(*answer: object, **settings: object) -> None:
            try:
                with time_limit(self.seconds):
                    check(*answer, **settings)
            except NotYet:
                raise
            except TooLong:
                found, expected = (
                    f"no result after {self.seconds:g} seconds",
                    "a result in that time: look for an endless loop",
                )
                raise self.wrong(found, expected) from None
            except Exception as error:
                found = f"an answer that raises an error ({type(error).__name__}: {error})"
                raise self.wrong(found, "an answer as the text describes it") from None

        return careful

    def passed(self, text: str) -> None:
        """Print that the answer is right."""
        print(*_lines(f"✓ {self.number} {self.name}: {text}"), sep="\n")

    def call(self, function: Callable, *arguments: object, keep: bool = False, empty: bool = False) -> object:
        """Call a student's function and return its result. It gets copies of `arguments` unless `keep`.

        Raises NotYet for a stub, an error, an argument altered in place, a call of the library's own function, and
        (unless `empty`) for no result.
        """
        self.refuse_if(not callable(function), f"{function!r}", "a function")
        given = arguments if keep else copy.deepcopy(arguments)
        try:
            with calls_of(self.refused) as called:
                result = function(*given)
        except NotImplementedError as error:
            stub = traceback.extract_tb(error.__traceback__)[-1].name
            if stub != getattr(function, "__name__", stub):
                expected = "that one written first, or vsp's function if the text names it"
                raise self.wrong(f"a call of your own `{stub}`, which is still a stub", expected) from None
            raise self.unsolved() from None
        except Exception as error:
            found = f"{type(error).__name__} ({error}) {_place(function, error)}"
            raise self.wrong(found, "a result: print what that line works with") from None
        self.refuse_if(bool(called), f"a call of vsp's `{''.join(called[:1])}`", "code of your own")
        self.refuse_if(result is None and not empty, "None as the result", "something after `return`")
        for i, (before, after) in enumerate(zip(arguments, given)):
            altered = isinstance(before, np.ndarray) and not np.array_equal(before, after)
            self.refuse_if(altered, f"{_parameter(function, i)} altered in place", "it as it was: work on a copy")
        return result

    def array(
        self, value: object, shape: tuple[int, ...], what: str = "a result", hint: int | None = None, meaning: str = ""
    ) -> np.ndarray:
        """Return `value` as an array of floats. Raises NotYet unless its shape is `shape` and all numbers are finite.
        `meaning` says what such an array should hold."""
        try:
            values = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            found = f"{what} that is not made of numbers, {value!r:.40}"
            raise self.wrong(found, f"numbers of shape {shape}", hint) from None
        expected = f"{shape}: {meaning}" if meaning else f"{shape}"
        self.refuse_if(values.shape != shape, f"{what} of shape {values.shape}", expected, hint)
        self.refuse_if(not np.isfinite(values).all(), f"NaN or infinity in {what}", "finite numbers", hint)
        return values

    def compare(self, value: object, right: object, mistakes: Sequence[Mistake], rtol: float = 1e-6) -> None:
        """Raise NotYet unless `value` equals `right`. The feedback is that of the first of `mistakes` with the
        result `value`; the last one matches any value."""
        if not _close(value, right, rtol):
            mistake = next(m for m in mistakes if m.result is None or _close(value, m.result, rtol))
            raise self.wrong(mistake.found, mistake.expected, mistake.hint)

    def answers(self, given: object, options: dict[str, Sequence[str] | type]) -> None:
        """Raise NotYet unless the dictionary `given` has one of the `options` (or a number) for each key."""
        self.refuse_if(not isinstance(given, dict), f"{given!r}", "a dictionary of answers")
        for key, choices in options.items():
            answer = given.get(key)
            if answer is None:
                todo = "write your answer in place of None and run that cell, without the stub"
                raise NotYet(f"{self.number} {self.name}: question {key!r} is not answered yet: {todo}.")
            if choices is float:
                number = isinstance(answer, int | float | np.number) and not isinstance(answer, bool)
                self.refuse_if(not number, f"{answer!r} for {key!r}", "a number")
            else:
                self.refuse_if(answer not in choices, f"{answer!r} for {key!r}", f"one of {list(choices)}")

    def ask(self, given: object, questions: dict[str, Question]) -> str:
        """Raise NotYet unless the dictionary `given` has the right answer to every question.

        Returns a sentence for `passed` that says how many of the first answers were right: who guesses sees it in the
        result.
        """
        self.answers(given, {key: question.options for key, question in questions.items()})
        first = self.first(given)
        for key, question in questions.items():
            if not self._right(question, key, given[key]):
                teaching = question.teaching.get(given[key], "look again")
                words = f"not {given[key]!r}: {teaching}.{self._pointer(question.hint)}"
                raise NotYet(f"{self.number} {self.name}, question {key!r}: {words}")
        right = sum(self._right(question, key, first[key]) for key, question in questions.items())
        return f" Of your first answers {right} of {len(questions)} were right."

    def first(self, given: dict) -> dict:
        """The first answers that this was called with since the kernel started."""
        return _FIRST.setdefault(self.number, dict(given))

    def _right(self, question: Question, key: str, answer: str) -> bool:
        return question.right in (answer, seal(self.number, key, answer))


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TooLong after `seconds`. Does nothing on Windows and outside the main thread, which get no signals."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise TooLong

    handler = signal.signal(signal.SIGALRM, stop)
    timer = signal.setitimer(signal.ITIMER_REAL, seconds, 1)  # again after a second, if a bare `except` caught it
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *timer)
        signal.signal(signal.SIGALRM, handler)


@contextmanager
def calls_of(functions: Sequence[str]) -> Iterator[list[str]]:
    """Collect the calls of `functions` ("module.name" each) inside the `with` block."""
    called, before = [], sys.getprofile()

    def watch(frame: FrameType, event: str, argument: object) -> None:
        name = f"{frame.f_globals.get('__name__')}.{frame.f_code.co_name}"
        if event == "call" and name in functions:
            called.append(frame.f_code.co_name)

    sys.setprofile(watch if functions else before)
    try:
        yield called
    finally:
        sys.setprofile(before)


def works(attempt: Callable, *given: object) -> bool:
    """Whether `attempt` raises no error."""
    try:
        attempt(*given)
    except Exception:
        return False
    return True


def joined(episodes: Iterable[Episode]) -> tuple[np.ndarray, np.ndarray]:
    """Concatenate the states (n, d) and actions (n, m) of all episodes."""
    parts = [(episode.states, episode.actions.astype(float)) for episode in episodes]
    return tuple(map(np.concatenate, zip(*parts)))


def seal(number: str, key: str, answer: str) -> str:
    """Hash an answer with salt, so that nobody can read it in the source."""
    return hashlib.sha256(f"vsp course|{number}|{key}|{answer}".encode()).hexdigest()[:16]


def _place(function: Callable, error: Exception) -> str:
    """Name the last line of the student's cell that ran before `error`."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"in line {lines[-1].lineno} of its cell, `{lines[-1].line}`" if lines else "when it is called"


def _parameter(function: Callable, i: int) -> str:
    """Name argument `i` of a function for a message."""
    try:
        return f"argument `{list(inspect.signature(function).parameters)[i]}`"
    except (TypeError, ValueError, IndexError):  # no signature, or `*arguments`
        return f"argument {i + 1}"


def _lines(text: str) -> list[str]:
    """Wrap `text` to lines that fit a notebook."""
    return textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _close(value: object, right: object, rtol: float) -> bool:
    value, right = np.asarray(value, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return value.shape == right.shape and np.allclose(value, right, rtol=rtol, atol=1e-9)
