"""Methods for walking robots: many inputs, several actions, and mistakes that add up.

Imitation includes states after pushes and after the policy's own mistakes. Then the teacher's own training continues,
with a few cells as its actor.
"""

from . import tasks
from .gait import record_gait
from .imitation import imitate_pushed
from .random_search import search_one_map
from .settings import Walking, walking_preset
