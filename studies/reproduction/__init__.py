"""Experiments on the reproduction: open choices of the paper, other teachers, and cells beside simpler policies."""
