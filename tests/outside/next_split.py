"""Another splitting pass: at most one split a pass, where the loss is largest."""

import numpy as np


def at_the_worst_state(partition, episode, config, rng):
    cells = partition.cells(episode.states)
    losses = [partition.loss(i, *step) for i, *step in zip(cells, episode.states, episode.actions)]
    worst = int(np.argmax(losses))
    state, i = episode.states[worst], cells[worst]
    if losses[worst] <= config.max_pol_loss or not partition.far(i, state):
        return []
    affected = np.append(partition.neighbours()[i], False)
    affected[i] = True
    partition.add(state, rng)
    partition.reset(affected)
    return [(state.copy(), losses[worst])]
