"""Train a TD3 teacher with Stable-Baselines3, resumably. Only the functions that train import torch and
stable_baselines3."""

import copy
import hashlib
import io
import os
import pickle
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from vsp.evaluation import rollout_from_seed
from vsp.run import atomic, sealed
from vsp.tasks import GOAL, PIT, get_task
from vsp.teachers import Teacher

CHUNK = 10_000  # steps between two checkpoints
SCORE_EPISODES, CURVE_EPISODES = 10_000, 500
OFTEN = {"BipedalWalker-v3": 4}  # factor on CURVE_EPISODES where a rare fall decides
SELECTION_SEED, SCORE_SEED = 101, 102  # seeds of start states: to select a training seed, and to report scores


@dataclass(frozen=True)
class Recipe:
    """Arguments of Stable-Baselines3's TD3 for one teacher; the policy is MlpPolicy, [400, 300], ReLU."""

    steps: int  # environment steps
    batch_size: int = 256
    train_freq: tuple[int, str] = (1, "step")
    gradient_steps: int = 1  # per training phase; -1: as many as steps were taken
    learning_rate: float = 1e-3
    gamma: float = 0.99  # discount per step
    buffer_size: int = 1_000_000
    learning_starts: int = 100
    noise: str = "normal"  # exploration noise: "normal" or "ornstein-uhlenbeck"
    noise_std: float = 0.1  # its standard deviation, in units of the action

    @property
    def id(self) -> str:
        """Eight hexadecimal digits of a hash: a checkpoint is resumed only with the same recipe."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:8]


RECIPES = {
    # "500.000 steps using the standard parameters": the library's defaults, with the exploration noise of the
    # TD3 article (Fujimoto et al. 2018); without noise, training never discovers that a short last step pays
    "SimpleGoal-v0": Recipe(steps=500_000),
    # RL Zoo's recipe with the library defaults of that time (batch 100, one training phase per episode)
    "MountainCarContinuous-v0": Recipe(
        steps=300_000, batch_size=100, train_freq=(1, "episode"), gradient_steps=-1,
        noise="ornstein-uhlenbeck", noise_std=0.5,
    ),
    # RL Zoo's recipe
    "Pendulum-v1": Recipe(steps=20_000, gamma=0.98, buffer_size=200_000, learning_starts=10_000),
    # With RL Zoo's recipe the return rises and falls; a larger buffer, a higher gamma and smaller steps stabilise it
    "LunarLanderContinuous-v3": Recipe(steps=450_000, learning_rate=3e-4, learning_starts=10_000),
    # RL Zoo's recipe with fewer steps
    "BipedalWalker-v3": Recipe(steps=300_000, gamma=0.98, buffer_size=200_000, learning_starts=10_000),
    "HalfCheetah-v5": Recipe(steps=350_000, learning_starts=10_000),
}  # fmt: skip

# Tasks whose teacher is the best snapshot of the learning curve; for other tasks it is the last one
BEST_OF_CURVE = ("LunarLanderContinuous-v3", "BipedalWalker-v3", "HalfCheetah-v5")


def train(task: str, *, seed: int, cache: str | os.PathLike, recipe: Recipe | None = None, report=print) -> Path:
    """Train a TD3 teacher for `task`, resuming from `cache`, and return the path of its last checkpoint. Training
    proceeds in chunks of `CHUNK` steps. Each chunk begins a new episode with new random streams from (seed, steps so
    far), so a run that was killed and resumed ends with the same weights as an uninterrupted one."""
    import torch

    torch.set_num_threads(1)
    torch.set_flush_denormal(True)  # Adam's moments of unused weights decay into denormal numbers, which are slow
    recipe = RECIPES[task] if recipe is None else recipe
    path = Path(cache) / f"{task}-{recipe.id}-{seed}.pt"
    model = _new_model(task, recipe, seed)
    snapshot: dict = {"curve": []}
    if path.exists():
        snapshot = read_checkpoint(path)
        _restore(model, snapshot)
    while model.num_timesteps < recipe.steps:
        chunk_seed = np.random.SeedSequence([seed, model.num_timesteps]).generate_state(1)[0]
        model.set_random_seed(int(chunk_seed))
        model._last_obs = None  # begin a fresh episode
        model.action_noise.reset()
        model.learn(min(CHUNK, recipe.steps - model.num_timesteps), reset_num_timesteps=False, log_interval=None)
        point = _score(model, task)
        report(f"{task} seed {seed}: {point}")
        snapshot |= _snapshot(model) | {"curve": [*snapshot["curve"], point]}
        best = max(snapshot["curve"], key=lambda point: point["mean"])  # the first of equally good ones
        if task not in BEST_OF_CURVE or point is best:
            snapshot["kept"] = {"point": point, "policy": copy.deepcopy(snapshot["parameters"]["policy"])}
        torch.save(snapshot, content := io.BytesIO())
        sealed.write_sealed(path, content.getvalue())
    return path


def read_checkpoint(path: str | os.PathLike) -> dict:
    """Read a checkpoint that `train` wrote. Raises FileNotFoundError or `run.atomic.DamagedFile`. torch's
    `weights_only` loading runs no code from the file."""
    import torch

    content = io.BytesIO(sealed.read_sealed(path))
    try:
        return torch.load(content, weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, KeyError) as error:
        raise atomic.DamagedFile(f"{path}: its checksum is right, but it is no checkpoint: {error!r:.300}") from error


def _new_model(task: str, recipe: Recipe, seed: int):
    import gymnasium
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise

    arguments = asdict(recipe)
    arguments.pop("steps")
    kind = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}[arguments.pop("noise")]
    m = len(get_task(task).action_low)
    noise = kind(np.zeros(m), arguments.pop("noise_std") * np.ones(m))
    return TD3("MlpPolicy", gymnasium.make(task), action_noise=noise, seed=seed, device="cpu", **arguments)


_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def _snapshot(model) -> dict:
    """Return the state of training between two chunks, in types that `weights_only` loading accepts."""
    import torch

    buffer = model.replay_buffer
    n = buffer.buffer_size if buffer.full else buffer.pos
    return {
        "parameters": model.get_parameters(),
        "buffer": {name: torch.from_numpy(getattr(buffer, name)[:n].copy()) for name in _BUFFER},
        "buffer_at": [buffer.pos, buffer.full],
        "counters": [model.num_timesteps, model._n_updates, model._episode_num],
    }


def _restore(model, snapshot: dict) -> None:
    model.set_parameters(snapshot["parameters"])
    for name, rows in snapshot["buffer"].items():
        getattr(model.replay_buffer, name)[: len(rows)] = rows.numpy()
    model.replay_buffer.pos, model.replay_buffer.full = snapshot["buffer_at"]
    model.num_timesteps, model._n_updates, model._episode_num = snapshot["counters"]


def _score(model, task: str) -> dict:
    """Return one point of the learning curve, over `CURVE_EPISODES` (fewer for slow tasks) from fixed starts."""
    n_episodes = CURVE_EPISODES * OFTEN.get(task, 1)
    weights = {name: tensor.numpy() for name, tensor in model.actor.state_dict().items()}
    return {"steps": model.num_timesteps, **score(Teacher(weights, task), task, n_episodes, seed=SELECTION_SEED)}


def score(teacher: Teacher, task: str, n_episodes: int = SCORE_EPISODES, *, seed: int = SCORE_SEED) -> dict:
    """Return the mean and standard deviation of the return, and the shares of episodes that end in goal and pit. Slow
    tasks are scored over fewer episodes."""
    result = rollout_from_seed(teacher, task, n_episodes // get_task(task).slowness, seed=seed)
    return {
        "mean": round(float(result.returns.mean()), 4),
        "std": round(float(result.returns.std(ddof=1)), 4),
        "goal": float(np.mean(result.outcomes == GOAL)),
        "pit": float(np.mean(result.outcomes == PIT)),
    }
