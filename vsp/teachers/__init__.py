"""Teachers: the shipped TD3 actors, a user's own agent, and the training of teachers."""

from .agents import agent, digest_of
from .teacher import SHIPPED, Teacher, load_teacher
