"""The course: what its notebooks draw with (`picture`), the checks of each lesson, and `build`, which makes the copies.

A lesson imports its checks by name, as in `from vsp.course import lesson_1 as check`.
"""

from .drawing import picture

__all__ = ["picture"]
