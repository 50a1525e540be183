import sys
from pathlib import Path

sys.path[:0] = map(str, (Path(__file__).parents[1], Path(__file__).parents[1] / "teachers"))  # `support`, `zips`
