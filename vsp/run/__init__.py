"""Infrastructure: atomic files, parallel workers with progress, and notebooks that run completely or change nothing."""

from .atomic import ROOT
