"""Shared by all checks: call a student's function on small cases, recognise common mistakes, print one line of
feedback.

Feedback names what was found and what was expected, and points to a hint. It never gives the answer.
"""

import contextlib
import copy
import functools
import hashlib
import inspect
import os
import sys
import textwrap
import threading
import tomllib
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

WIDTH = 83  # characters of a message's lines: nbgrader's Validate cuts longer ones
SEED = abs(int(os.environ.get("VSP_COURSE_SEED", 0)))  # of all cases; an exam has one that nobody knows
_FIRST: dict[str, dict] = {}  # the first complete answers to each exercise with questions


def generators(n: int) -> list[np.random.Generator]:
    """Return random generators for the cases of a check."""
    return [np.random.default_rng([SEED, i]) for i in range(n)]


def tables(name: str) -> dict[str, Any]:
    """Return the tables of a file beside this module."""
    return tomllib.loads(Path(__file__).with_name(name).read_text("utf-8"))


class NotYet(AssertionError):
    """An answer that is missing or wrong. Jupyter shows its message without a traceback."""

    def _render_traceback_(self) -> list[str]:
        return _lines(f"✗ {self}")


class Mistake(NamedTuple):
    """The wrong result of a common mistake, and the feedback for it."""

    result: object  # numbers, compared with what the student's function returned; None: any others
    found: str
    expected: str
    hint: int | None = None


@dataclass(frozen=True)
class Exercise:
    """One exercise: its number, and the name that the student defines."""

    number: str
    name: str
    refused: tuple[Callable, ...] = ()  # functions of vsp that the answer must not call, by whatever name
    cures: tuple[tuple[type, str, int], ...] = ()  # type of an error, words of its message, the hint that helps

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
        """Decorate the exercise's check: errors inside it become feedback too."""

        @functools.wraps(check)
        def careful(*answer: object) -> None:
            try:
                check(*answer)
            except NotYet:
                raise
            except Exception as error:
                found = f"an answer that raises an error ({type(error).__name__}: {error})"
                raise self.wrong(found, "an answer as the text describes it") from None

        return careful

    def passed(self, text: str) -> None:
        """Print that the answer is right."""
        print(*_lines(f"✓ {self.number} {self.name}: {text}"), sep="\n")

    def call(self, function: Callable, *arguments: object, keep: bool = False, empty: bool = False) -> Any:
        """Call a student's function and return its result. It gets copies of `arguments`; with `keep`, the first one
        itself, to be altered. Raises NotYet for a stub, an error, an interrupt, an argument altered in place, a call of
        the library's own function, and (unless `empty`) for no result."""
        self.refuse_if(not callable(function), f"{function!r}", "a function")
        given = copy.deepcopy(arguments, {id(arguments[0]): arguments[0]} if keep else None)
        try:
            with _noted(self.refused) as called:
                result = function(*given)
        except BaseException as error:
            raise self._failure(function, error) from None
        for name in [function.__name__ for function in self.refused if function.__name__ in called]:
            raise self.wrong(f"a call of vsp's `{name}`", "code of your own")
        self.refuse_if(result is None and not empty, "None as the result", "something after `return`")
        for i, (before, after) in enumerate(zip(arguments, given), 1):
            now = _arrays(after)
            same = all(_close(now.get(name, ()), array, 1e-9) for name, array in _arrays(before).items())
            self.refuse_if(not same, f"argument {i} altered in place", "it as it was: work on a copy")
        return result

    def _failure(self, function: Callable, error: BaseException) -> NotYet:
        """Return the exception to raise if a student's function ends with `error`."""
        if type(error).__name__ == "StdinNotImplementedError":  # a kind of NotImplementedError
            return self.wrong(f"a call of `input` {_place(function, error)}", "a result from the arguments alone")
        if isinstance(error, NotImplementedError):
            stub = traceback.extract_tb(error.__traceback__)[-1].name
            if stub == getattr(function, "__name__", stub):
                return self.unsolved()
            expected = "that one written first, or vsp's function if the text names it"
            return self.wrong(f"a call of your own `{stub}`, which is still a stub", expected)
        if isinstance(error, KeyboardInterrupt):
            return self.wrong(f"no end {_place(function, error)}", "one: look for an endless loop")
        hints = (hint for kind, words, hint in self.cures if isinstance(error, kind) and words in str(error))
        found = f"{type(error).__name__} ({error}) {_place(function, error)}"
        return self.wrong(found, "a result: print what that line works with", next(hints, None))

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
        """Raise NotYet unless `value` equals `right`, up to `rtol` of its largest number. The feedback is that of the
        first of `mistakes` with the result `value`; the last one matches any value."""
        if not _close(value, right, rtol):
            mistake = next(m for m in mistakes if m.result is None or _close(value, m.result, min(rtol, 0.02)))
            raise self.wrong(mistake.found, mistake.expected, mistake.hint)

    def answers(self, given: Any, options: Mapping[str, Sequence[str]]) -> None:
        """Raise NotYet unless the dictionary `given` has one of the `options` for each key, or without any, a value."""
        self.refuse_if(not isinstance(given, dict), f"{given!r}", "a dictionary of answers")
        for key, choices in options.items():
            answer = given.get(key)
            if answer is None:
                todo = "write your answer in place of None and run that cell, without the stub"
                raise NotYet(f"{self.number} {self.name}: question {key!r} is not answered yet: {todo}.")
            unknown = len(choices) > 0 and answer not in choices
            self.refuse_if(unknown, f"{answer!r} for {key!r}", f"one of {list(choices)}")

    def ask(self, given: Any, text: str) -> None:
        """Raise NotYet unless the dictionary `given` has the right answer to every question of the exercise in
        questions.toml; else print `text`. With it comes how many of the first answers were right: who guesses sees it
        in the result."""
        questions = tables("questions.toml")[self.number]
        first = self.first(given, {key: question["options"] for key, question in questions.items()})
        right = [seal(self.number, key, first[key]) == question["right"] for key, question in questions.items()]
        for key, question in questions.items():
            if seal(self.number, key, given[key]) != question["right"]:
                words = f"not {given[key]!r}: {question.get('teaching', {}).get(given[key], 'look again')}."
                raise NotYet(f"{self.number} {self.name}, question {key!r}: {words}{self._pointer(question['hint'])}")
        self.passed(f"{text} Of your first answers {sum(right)} of {len(questions)} were right.")

    def first(self, given: Any, options: Mapping[str, Sequence[str]]) -> dict:
        """The first complete answers since the kernel started. Raises NotYet as `answers` does."""
        self.answers(given, options)
        return _FIRST.setdefault(self.number, dict(given))


def seal(number: str, key: str, answer: str) -> str:
    """Hash an answer with salt, so that nobody can read it in the source."""
    return hashlib.sha256(f"vsp course|{number}|{key}|{answer}".encode()).hexdigest()[:16]


@contextlib.contextmanager
def _noted(refused: Sequence[Callable]) -> Iterator[set[str]]:
    """Note which functions are called meanwhile, by whatever name. Nothing in them is changed."""
    codes, called = {inspect.unwrap(function).__code__: function.__name__ for function in refused}, set()
    before = sys.getprofile()

    def note(frame: Any, event: str, _: object) -> None:
        if event == "call" and frame.f_code in codes:
            called.add(codes[frame.f_code])

    if codes:
        threading.setprofile(note)
        sys.setprofile(note)
    try:
        yield called
    finally:
        threading.setprofile(None)
        sys.setprofile(before)


def _arrays(value: object, name: str = "", depth: int = 3) -> dict[str, np.ndarray]:
    """The arrays of numbers in `value` and in its parts, by name."""
    if isinstance(value, np.ndarray):
        return {name: value} if value.dtype.kind in "biuf" else {}
    parts = dict(enumerate(value)) if isinstance(value, list | tuple) else getattr(value, "__dict__", {})
    parts = parts if depth else {}
    return {k: v for key, part in parts.items() for k, v in _arrays(part, f"{name}.{key}", depth - 1).items()}


def _place(function: Callable, error: BaseException) -> str:
    """Name the last line of the student's cell that ran before `error`."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"in line {lines[-1].lineno} of its cell, `{lines[-1].line}`" if lines else "when it is called"


def _lines(text: str) -> list[str]:
    """Wrap `text` to lines that fit a notebook."""
    return textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _close(value: object, right: object, rtol: float) -> bool:
    value, right = np.asarray(value, dtype=np.float64), np.asarray(right, dtype=np.float64)
    within = rtol * np.abs(right).max(initial=1e-3)
    return value.shape == right.shape and bool((np.abs(value - right) <= within).all())
