"""Another distance: Minkowski's of order 3, and one that goes round a circle."""

import numpy as np

import vsp

MINKOWSKI = vsp.Metric("minkowski 3", order=3)


def round_the_circle(states, codewords):
    gaps = states[:, None] - codewords
    return np.abs(gaps - np.round(gaps)).sum(axis=2)


CIRCLE = vsp.Metric("circle", between=round_the_circle, term="fabs(remainder(gap, 1.0))")
