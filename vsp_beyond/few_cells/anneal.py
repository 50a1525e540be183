"""Deterministic annealing (Rose 1998): gradient descent on the imitation error, of all numbers of cells together."""

from dataclasses import replace

import numpy as np

from vsp.subpolicies.stacked import BETA1, adam

from .config import Tuned
from .units import LabelledStates, ScaledCells, expected_loss, temperature_unit

WARM = 10  # initial temperature for cells that are already good, in units of the final temperature


def warm(config: Tuned) -> Tuned:
    """Return `config` for cells that are already good: annealing begins colder and takes half as many steps."""
    heat = min(config.initial_temperature, WARM * config.final_temperature)
    return replace(config, initial_temperature=heat, n_steps=max(1, config.n_steps // 2))


def linear_init(labelled: LabelledStates, k: int, rng: np.random.Generator) -> ScaledCells:
    """k codewords near states drawn from `labelled`; every cell gets the least-squares coefficients of all states."""
    states, common = labelled.states, np.linalg.lstsq(labelled.inputs, labelled.actions, rcond=None)[0]
    codewords = states[rng.integers(len(states), size=k)] + 0.01 * rng.normal(size=(k, states.shape[1]))
    return ScaledCells(codewords, np.tile(common, (k, 1, 1)))


def random_init(labelled: LabelledStates, k: int, rng: np.random.Generator) -> ScaledCells:
    """`linear_init` with a little noise in every coefficient."""
    cells = linear_init(labelled, k, rng)
    return ScaledCells(cells.codewords, cells.coefficients + 0.1 * rng.normal(size=cells.coefficients.shape))


def anneal(labelled: LabelledStates, cells: ScaledCells, config: Tuned, rng: np.random.Generator) -> ScaledCells:
    """Optimise all numbers of `cells` by Adam while the temperature falls from the initial to the final of `config`.

    Deterministic annealing (Rose 1998): each state belongs to all cells in shares that fall with the distance. The
    lower the temperature, the faster they fall. The last tenth of the steps stays at the final temperature.
    """
    unit = temperature_unit(labelled, len(cells))
    first, n_steps = config.initial_temperature, config.n_steps
    theta, draw = cells.vector, labelled.draw(config.batch_size, rng)
    mean = square = np.zeros_like(theta)
    for i in range(n_steps):
        done = i / n_steps
        temperature = unit * first * (config.final_temperature / first) ** min(1.0, done / 0.9)
        rows = draw()
        batch = cells.like(theta), labelled.inputs[rows], labelled.actions[rows]
        _, gradient = expected_loss(*batch, temperature=temperature, clip_slope=config.clip_slope)
        mean, square, spread = adam(gradient, mean, square, i + 1)
        step = mean / (1 - BETA1 ** (i + 1)) / spread
        theta = theta - config.learning_rate * (1 - done) * step
    return cells.like(theta)
