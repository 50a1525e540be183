"""Methods for walking robots: imitation also after pushes and mistakes, then training with a few cells as the actor."""

from .imitation import imitate_pushed
from .random_search import search_one_map
from .settings import Walking, walking_preset
from .tasks import record_gait
