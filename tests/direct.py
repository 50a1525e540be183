"""The direct way: Algorithms 1, 2 and 3 as one writes them down from the paper, without a thought of speed.

A second route to what `vsp.distill` does, and the slow side of `make bench`: a prediction of a Stable-Baselines3 agent
and a step of a Gymnasium environment at a time, a torch module, an optimiser and two lists per cell. It knows the
default readings alone, and draws in the order in which `vsp.distill` draws: the same seed gives both the same starts,
first parameters and minibatches. Codewords in a line are not provided for.
"""

from __future__ import annotations

from types import SimpleNamespace

import gymnasium
import numpy as np
import torch
from scipy.spatial import Delaunay, KDTree
from torch.nn.functional import mse_loss

import vsp
from vsp import Config, algorithms
from vsp.rollouts import Episode
from vsp.teachers import SHIPPED


def evaluate_directly(policy, task: str, n_episodes: int, *, seed: int) -> np.ndarray:
    """Returns (n,) by Stable-Baselines3's `evaluate_policy`, from the starts that `vsp.evaluate` has for this seed."""
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.monitor import Monitor

    env = gymnasium.make(task)
    env.unwrapped.np_random = np.random.default_rng(np.random.SeedSequence(seed))
    model = SimpleNamespace(predict=lambda obs, **_: policy.predict(obs))  # asked as recurrent ones are, too
    returns, _ = evaluate_policy(model, Monitor(env), n_episodes, return_episode_rewards=True)
    return np.array(returns)


class OneByOne:
    """An agent that is asked for one observation at a time, whoever asks: float32 rounds otherwise in a batch."""

    def __init__(self, agent):
        self.agent = agent

    def predict(self, obs):
        return np.array([self.agent.predict(one, deterministic=True)[0] for one in obs]), None


def same_run(found, teacher, task: str, config: Config, seed: int, monkeypatch) -> bool:
    """Whether `vsp.distill` does, with the episodes of the direct way's run `found`, what was done there."""
    cells, events, losses, episodes = found
    played = [Episode(*map(np.array, zip(*episode))) for episode in episodes]
    with monkeypatch.context() as patch:
        patch.setattr(algorithms, "teacher_episodes", lambda *_: iter(played))
        policy, history = vsp.distill(teacher, task, config, seed=seed)
    own = [(event.iteration, event.kind, tuple(event.codeword)) for event in history.events]
    return (
        own == [(n, kind, tuple(codeword)) for n, kind, codeword in events]
        and np.array_equal(policy.codewords, [cell.codeword for cell in cells])
        and np.allclose(policy.coefficients, [cell.parameters() for cell in cells], rtol=0, atol=1e-9)
        and np.allclose(history.losses, losses, rtol=0, atol=1e-9)
    )


def teacher_agent(task: str):
    """The shipped teacher as the agent of Stable-Baselines3 that it was."""
    from safetensors.torch import load_file
    from stable_baselines3 import TD3

    agent = TD3("MlpPolicy", gymnasium.make(task), buffer_size=1, device="cpu")  # layers [400, 300], its own default
    missing, unexpected = agent.policy.load_state_dict(load_file(SHIPPED / f"{task}.safetensors"), strict=False)
    assert not unexpected and all("target" in name for name in missing), (missing, unexpected)
    return agent


class Cell:
    """A codeword (d,), its linear sub-policy, and the states and actions seen there."""

    def __init__(self, codeword: np.ndarray, m: int, learning_rate: float, rng: np.random.Generator):
        self.codeword, d = codeword, len(codeword)
        self.linear = torch.nn.Linear(d, m, dtype=torch.float64)
        first = torch.from_numpy(rng.uniform(-1 / np.sqrt(d), 1 / np.sqrt(d), size=(d + 1, m)))
        with torch.no_grad():
            self.linear.weight.copy_(first[:-1].T)
            self.linear.bias.copy_(first[-1])
        self.optimiser = torch.optim.Adam(self.linear.parameters(), lr=learning_rate)
        self.reset()

    def reset(self) -> None:
        self.states, self.actions = [], []

    def train(self, batch_size: int, rng: np.random.Generator) -> float:
        """A step of Adam on a minibatch; returns the loss before it."""
        chosen = (rng.random(batch_size) * len(self.states)).astype(int)
        states = torch.from_numpy(np.array([self.states[i] for i in chosen]))
        actions = torch.from_numpy(np.array([self.actions[i] for i in chosen]))
        loss = mse_loss(self.linear(states), actions)
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        return loss.item()

    def loss(self, state: np.ndarray, action: np.ndarray) -> float:
        with torch.no_grad():
            return mse_loss(self.linear(torch.from_numpy(state)), torch.from_numpy(action)).item()

    def parameters(self) -> np.ndarray:
        """Weights, then the bias. (d + 1, m)"""
        return torch.cat([self.linear.weight.T, self.linear.bias[None]]).detach().numpy()


def distill(agent, env, config: Config, *, seed: int):
    """Algorithm 1. Returns the cells, the events (iteration, kind, codeword), the losses, and the episodes."""
    starts, init, batches = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    env.unwrapped.np_random = starts
    m, cells, events, losses, episodes = env.action_space.shape[0], [], [], [], []
    for n in range(config.n_epochs):
        episode, (observation, _), ended = [], env.reset(), False
        if n == 0:
            cells.append(Cell(observation.astype(np.float64), m, config.learning_rate, init))
        tree = kd_tree(cells)
        while not ended:
            action, _ = agent.predict(observation, deterministic=True)
            state = observation.astype(np.float64)
            observation, _, terminated, truncated, _ = env.step(action)
            ended, action = terminated or truncated, action.astype(np.float64)
            cell = cells[nearest(tree, state)]
            cell.states.append(state)
            cell.actions.append(action)
            episode.append((state, action))
        losses.append(np.mean([cell.train(config.batch_size, batches) for cell in cells if cell.states]))
        if 0 < n < config.n_epochs - config.n_freeze:
            if n % config.n_split == 0:
                events += [(n, "split", codeword) for codeword in split_regions(cells, episode, config, init)]
            if n % config.n_merge == 0:
                events += [(n, "merge", codeword) for codeword in merge_regions(cells, config)]
        if n and n % config.n_reset == 0:
            for cell in cells:
                cell.reset()
        episodes.append(episode)
    return cells, events, losses, episodes


def kd_tree(cells: list[Cell]) -> KDTree:
    return KDTree([cell.codeword for cell in cells])


def nearest(tree: KDTree, state: np.ndarray) -> int:
    return tree.query(state, p=1)[1]


def neighbours(cells: list[Cell], i: int) -> list[Cell]:
    """The cells that share an edge of the Delaunay triangulation with cell i; as many as make one triangle all do."""
    if len(cells) <= len(cells[i].codeword) + 1:
        return [cell for cell in cells if cell is not cells[i]]
    starts, others = Delaunay([cell.codeword for cell in cells]).vertex_neighbor_vertices
    return [cells[j] for j in others[starts[i] : starts[i + 1]]]


def split_regions(cells: list[Cell], episode: list, config: Config, rng: np.random.Generator) -> list[np.ndarray]:
    """Algorithm 2. Returns the new codewords."""
    previous, losses, added = None, [], []
    for state, action in episode:
        i = nearest(kd_tree(cells), state)
        if i != previous:
            previous, losses = i, []
        losses.append(cells[i].loss(state, action))
        far = np.abs(state - cells[i].codeword).sum() > config.min_pol_distance
        if np.mean(losses) > config.max_pol_loss and far:
            for cell in (cells[i], *neighbours(cells, i)):
                cell.reset()
            cells.append(Cell(state, len(action), config.learning_rate, rng))
            losses = []
            added.append(state)
    return added


def merge_regions(cells: list[Cell], config: Config) -> list[np.ndarray]:
    """Algorithm 3. Returns the removed codewords, in the order in which their cells came."""
    before = list(cells)
    for cell in before:
        if cell not in cells:
            continue
        near = neighbours(cells, cells.index(cell))
        for other in near:
            if np.abs(cell.parameters() - other.parameters()).max() < config.min_param_distance:
                cells.remove(other)
                for affected in (cell, *near):
                    affected.reset()
    return [cell.codeword for cell in before if cell not in cells]
