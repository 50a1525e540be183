"""The paper's protocol for any method: what a `Method` is, files of results, `compare`, intervals."""

from .comparison import Comparison, compare
from .intervals import crossed_interval, interval, percentile_interval, share_interval
from .job import EVALUATION_SEED, N_EPISODES, Job
from .method import Method, paper_method
