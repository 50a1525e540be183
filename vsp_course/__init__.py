"""The course: the drawing helper of its notebooks (`picture`), the checks of each lesson, `build`, which writes the
versions for students and lecturers, `grade` for exams, and `live`, the page without Python.

A lesson imports its checks by name, as in `from vsp_course import lesson_1 as check`.
"""

from .drawing import picture

__all__ = ["picture"]
