"""Tasks: continuous control whose observations and actions are boxes, one file a task.

To add one, write a module like `mountaincar.py` with its `TASK`, and enter it in `registry`. `base` defines what a task
is; `gym_adapter` makes one of any Gymnasium environment.
"""

from .base import ENDED, GOAL, OUTCOMES, PIT, RUNNING, TRUNCATED, Signals, Task
from .registry import SLOW, get_task, register, render, task_names
