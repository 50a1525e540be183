"""Continuous-control tasks whose observations and actions are boxes, one file per task.

To add one, write a module like `mountaincar.py` with its `TASK`, and enter it in `registry`. `base` defines `Task`;
`gym_adapter` makes a `Task` from any Gymnasium environment.
"""

from .base import ENDED, GOAL, OUTCOMES, PIT, RUNNING, TRUNCATED, Task
from .registry import get_task, register, register_maker, task_names
