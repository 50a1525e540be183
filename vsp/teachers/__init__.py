"""Teachers: the shipped TD3 actors, a reader's own agent, and how teachers are trained."""

from .agents import agent
from .teacher import SHIPPED, Teacher, load_teacher
