from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree
from support import PENDULUM

from studies.robots.imitation import Pushed, imitate_pushed
from studies.robots.settings import Walking
from vsp import agent, get_task, load_teacher, visited_states

FEW = Walking(n_cells=3, n_episodes=4, n_corrections=1, n_correction_episodes=2, n_states=1500, n_restarts=1)


def test_a_push_of_no_size_changes_nothing_and_a_large_one_stays_in_the_box():
    task, teacher, rng = get_task(PENDULUM), load_teacher(PENDULUM), np.random.default_rng(0)
    states = visited_states(teacher, task, task.start(rng, 5))
    unpushed = teacher.predict(states)[0]
    assert np.allclose(Pushed(teacher, task, 0.0, rng).predict(states)[0], unpushed)
    pushed = Pushed(teacher, task, 0.5, rng).predict(states)[0]
    inner = np.abs(unpushed) < 0.1
    assert np.abs(pushed).max() <= 2 and 0.8 < np.std((pushed - unpushed)[inner]) < 1.2  # half of the range of 2


def test_imitation_acts_and_repeats():
    task, teacher, some = get_task(PENDULUM), load_teacher(PENDULUM), replace(FEW, n_restarts=4)
    policy, again, other = (imitate_pushed(teacher, PENDULUM, some, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(policy.coefficients, again.coefficients) and len(policy) == 3
    assert not np.array_equal(policy.coefficients, other.coefficients)
    states = visited_states(teacher, task, task.start(np.random.default_rng(3), 50))
    wanted = teacher.predict(states)[0]
    assert np.square(policy.predict(states)[0] - wanted).mean() < 0.6 * wanted.var()  # R² 0.4


def test_corrections_and_pushes_bring_states_that_the_teacher_never_sees():
    task, teacher, rounds = get_task(PENDULUM), load_teacher(PENDULUM), []

    def idle(frame, seen, before, rng):
        rounds.append(frame.states(seen.inputs))
        return agent(lambda obs: np.zeros((len(obs), 1)))

    imitate_pushed(teacher, PENDULUM, replace(FEW, n_states=10**6, n_corrections=2), seed=0, fit=idle)
    assert [len(states) for states in rounds] == [3 * 4 * 200, (3 * 4 + 2) * 200, (3 * 4 + 4) * 200]
    known = KDTree(visited_states(teacher, task, task.start(np.random.default_rng(9), 100)))
    own, pushed, visited = (known.query(rounds[-1][part])[0].mean() for part in np.split(np.arange(3200), [800, 2400]))
    assert pushed > 1.5 * own and visited > 3 * own
