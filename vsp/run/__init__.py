"""Machinery: files that are whole or absent, workers with progress, and notebooks run as a whole or not at all."""

from .atomic import ROOT
