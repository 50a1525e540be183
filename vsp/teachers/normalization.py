"""Normalised observations: the statistics of Stable-Baselines3's `VecNormalize`, and what tells they are needed."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..checks import check_array
from ..run import atomic
from .agent_zip import Saved
from .inert import LARGEST, Thing, array, described

LARGEST_SETTINGS = 2**20  # bytes of a file of settings
_CLASS = "stable_baselines3.common.vec_env.vec_normalize.VecNormalize"


class Normalization(NamedTuple):
    """What turns raw observations into those that an agent was trained on."""

    mean: np.ndarray  # (d,)
    variance: np.ndarray  # (d,)
    epsilon: float
    clip: float

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        """Return normalised observations (n, d)."""
        return np.clip((observations - self.mean) / np.sqrt(self.variance + self.epsilon), -self.clip, self.clip)


def read_normalization(path: str | os.PathLike, d: int) -> Normalization | None:
    """Return the statistics of d observations in a pickle of `VecNormalize`, without running it; None if it says that
    observations are not normalised.

    Raises `MissingFile`, `DamagedFile`, and ValueError for statistics that do not fit.
    """
    content = atomic.read_bytes(path, LARGEST)
    try:
        saved = described(content)
        fields = saved.state if isinstance(saved, Thing) and saved.name == _CLASS else None
        if not isinstance(fields, dict):
            raise ValueError(f"expected a {_CLASS}")
        if not array(fields.get("norm_obs", True), "norm_obs"):
            return None
        running = fields["obs_rms"]
        parts = {} if isinstance(running, dict) else running.state
        moments = {name: array(parts[name], name) for name in ("mean", "var") if name in parts}
        numbers = {name: float(array(fields[name], name)) for name in ("epsilon", "clip_obs")}
    except Exception as error:  # of any kind: the content is not trusted
        raise atomic.DamagedFile(f"{path}: not the statistics of observations: {error!r:.300}") from error
    return checked(moments, numbers["epsilon"], numbers["clip_obs"], d, str(path))


def of_model(model: Any, normalize: str | os.PathLike | bool | None = None) -> Normalization | None:
    """Return the statistics of a model in memory: those in the file `normalize`, or its own; None if it has none.

    Raises ValueError if it has none, but keeps what an on-policy agent keeps only beside them.
    """
    d = (getattr(getattr(model, "observation_space", None), "shape", None) or (0,))[0]
    if isinstance(normalize, str | os.PathLike):
        return read_normalization(normalize, d)
    found = getattr(model, "get_vec_normalize_env", lambda: None)()
    kept = getattr(model, "_last_original_obs", None) is not None and not hasattr(model, "replay_buffer")
    if found is None and normalize is not False and (kept or normalize):
        raise ValueError(
            "the model was trained on normalised observations, but came without their statistics: expected "
            'vsp.agent(model, normalize="vecnormalize.pkl"), or normalize=False if there are none'
        )
    if found is None or normalize is False or not found.norm_obs:
        return None
    moments = {} if isinstance(found.obs_rms, dict) else vars(found.obs_rms)
    return checked(moments, found.epsilon, found.clip_obs, d, "the model's VecNormalize")


def checked(moments: dict, epsilon: float, clip: float, d: int, where: str) -> Normalization:
    """Return the statistics. Raises ValueError unless they are finite and belong to d observations."""
    if not {"mean", "var"} <= {*moments}:
        raise ValueError(f"{where}: statistics of a dictionary of observations, expected those of one array of {d}")
    mean, variance = (check_array(f"{where}: {name}", moments[name], (d,)) for name in ("mean", "var"))
    if (variance < 0).any() or not 0 <= epsilon < np.inf or not (variance + epsilon > 0).all() or not clip > 0:
        raise ValueError(
            f"{where}: variance {variance.tolist()}, epsilon {epsilon}, clip {clip}, expected positive ones"
        )
    return Normalization(mean, variance, epsilon, clip)


def statistics_beside(path: Path) -> Path | None:
    """Return the file of `VecNormalize` that lies beside the zip at `path` under a common name; None: there is none."""
    name, plain = path.with_suffix(""), ("vecnormalize.pkl", "vec_normalize.pkl")
    checkpoint = re.sub(r"_(\d+_steps)$", r"_vecnormalize_\1", str(name))
    in_folders = [folder / file for folder in (name, path.parent) for file in plain]  # of the zoo, and of its hub
    files = Path(f"{name}.vecnormalize.pkl"), Path(f"{checkpoint}.pkl"), *in_folders
    return next((file for file in files if file.exists()), None)


def sign(path: Path, saved: Saved) -> str:
    """Return what shows that the agent in the zip at `path` was trained on normalised observations; empty: nothing."""
    name = path.with_suffix("")
    if beside := statistics_beside(path):
        return f"{beside} lies beside it"
    for settings in (Path(f"{name}.config.yml"), name / "config.yml", path.parent / "config.yml"):
        if settings.is_file() and _says_normalize(settings):
            return f"{settings} says so"
    # An agent with a buffer, off policy, keeps them without a normalisation too
    if "buffer_size" not in saved.settings and saved.settings.get("_last_original_obs") is not None:
        return "it keeps observations from before a normalisation (_last_original_obs)"
    return ""


def _says_normalize(path: Path) -> bool:
    """Whether a file of settings asks for normalised observations. Its YAML is read as plain nodes: nothing is built.

    `normalize` may be true, a mapping, or a text such as "dict(norm_obs=True, norm_reward=False)".
    """
    import yaml  # here: few agents have such a file

    try:
        with open(path, "rb") as file:
            nodes = [yaml.compose(file.read(LARGEST_SETTINGS), Loader=yaml.SafeLoader)]
        seen = set()
        for node in nodes:  # which grows: a mapping, or a list of pairs as the zoo writes it
            pairs = node.value if isinstance(node, yaml.MappingNode) else []
            if isinstance(node, yaml.SequenceNode) and id(node) not in seen:  # an alias may lead back
                seen.add(id(node))
                nodes += node.value
                pairs = [node.value] if len(node.value) == 2 else []
            for value in [value for key, value in pairs if key.value == "normalize"]:
                text = str(value.value) if isinstance(value, yaml.ScalarNode) else yaml.serialize(value)
                off = text.strip().lower() in ("false", "no", "off", "null", "none", "~", "")
                return not off and not re.search(r"(?i)norm_obs['\"]?\s*[=:]\s*(false|no|off)\b", text)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError):
        pass
    return False
