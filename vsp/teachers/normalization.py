"""Normalised observations: the statistics of Stable-Baselines3's `VecNormalize`, and what tells they are needed."""

import os
import re
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..checks import check_array
from ..run import atomic
from .agent_zip import Saved
from .inert import LARGEST, Thing, array, described

LARGEST_SETTINGS = 2**20  # bytes of a file of settings
_NAMED = re.compile(r"(?i)vec_?norm")
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
    observations are not normalised. Raises `MissingFile`, `DamagedFile`, and ValueError for statistics that do not
    fit."""
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
        text = f"{path}: not the statistics of observations, as VecNormalize saves them: {error!r:.100}"
        raise atomic.DamagedFile(f"{text}. From elsewhere, pass normalize=(mean, variance)") from error
    return checked(moments, numbers["epsilon"], numbers["clip_obs"], d, str(path))


def statistics_of(normalize: Any, d: int = -1) -> Normalization | None:
    """Return the statistics in what a user gives: a file of `VecNormalize`, such an object, or (mean, variance); None
    if they say that observations are not normalised. d is the number of observations; -1: any. Raises as
    `read_normalization` does, and ValueError for anything else."""
    if isinstance(normalize, str | os.PathLike):
        return read_normalization(normalize, d)
    if hasattr(normalize, "obs_rms") and hasattr(normalize, "epsilon"):
        return _of_running(normalize, d)
    if isinstance(normalize, tuple | list) and len(normalize) == 2:
        warnings.warn("normalize=(mean, variance) takes VecNormalize's defaults: epsilon 1e-8, limit 10", stacklevel=3)
        return checked(dict(zip(("mean", "var"), normalize)), 1e-8, 10.0, d, "normalize")
    raise ValueError(
        f"normalize is {normalize!r:.60}, expected a file of VecNormalize, this object, (mean, variance), True or False"
    )


def _of_running(wrapper: Any, d: int) -> Normalization | None:
    """Return the statistics of a `VecNormalize`, or of Gymnasium's `NormalizeObservation`, which has no limit."""
    if not getattr(wrapper, "norm_obs", True):
        return None
    moments = {} if isinstance(wrapper.obs_rms, dict) else vars(wrapper.obs_rms)
    limits = getattr(wrapper, "epsilon", np.nan), getattr(wrapper, "clip_obs", np.inf)
    return checked(moments, *limits, d, f"the model's {type(wrapper).__name__}")


def of_model(model: Any, normalize: Any = None) -> Normalization | None:
    """Return the statistics of a model in memory: those that `normalize` gives, or those of its environment; None if it
    has none. Raises ValueError if it has none, but keeps what an on-policy agent keeps only beside them."""
    d = (getattr(getattr(model, "observation_space", None), "shape", None) or (-1,))[0]
    if not (normalize is None or isinstance(normalize, bool)):
        return statistics_of(normalize, d)
    found = [] if normalize is False else _wrappers(model)
    kept = getattr(model, "_last_original_obs", None) is not None and not hasattr(model, "replay_buffer")
    if not found and normalize is not False and (kept or normalize):
        raise ValueError(
            "the model was trained on normalised observations, but came without their statistics: expected "
            'vsp.agent(model, normalize="vecnormalize.pkl"), or normalize=False if there are none'
        )
    used = [statistics for one in found if (statistics := _of_running(one, d))]
    if len(used) > 1:
        raise ValueError("the model's observations are normalised twice, expected once: wrap the model in a function")
    return used[0] if used else None


def _wrappers(model: Any) -> list[Any]:
    """Return what normalises the observations of a model's environment: `VecNormalize`, and what wraps the first of its
    environments, such as Gymnasium's `NormalizeObservation`. Raises ValueError if that runs in another process."""
    found = [getattr(model, "get_vec_normalize_env", lambda: None)()]
    env = getattr(model, "get_env", lambda: None)()
    while (inner := getattr(env, "venv", None)) is not None:  # a wrapper of all environments
        env = inner
    elsewhere = None if hasattr(env, "envs") else getattr(env, "has_attr", None)
    if elsewhere and elsewhere("obs_rms"):
        raise ValueError("the model's environments normalise elsewhere: expected normalize=(mean, variance)")
    env = next(iter(getattr(env, "envs", ())), None)
    while env is not None:
        found += [env] if "obs_rms" in vars(env) else []
        env = getattr(env, "env", None)
    return [one for one in found if one is not None]


def checked(moments: dict, epsilon: float, clip: float, d: int, where: str) -> Normalization:
    """Return the statistics. Raises ValueError unless they are finite and belong to d observations."""
    if not {"mean", "var"} <= {*moments}:
        raise ValueError(f"{where}: statistics of a dictionary of observations, expected those of one array of {d}")
    mean, variance = (check_array(f"{where}: {name}", moments[name], (d,)) for name in ("mean", "var"))
    if (variance < 0).any() or not 0 <= epsilon < np.inf or not (variance + epsilon > 0).all() or not clip > 0:
        said = f"variance {variance.tolist()}, epsilon {epsilon}, clip {clip}"
        raise ValueError(f"{where}: {said}, expected positive ones")
    return Normalization(mean, variance, epsilon, clip)


def statistics_beside(path: Path) -> Path | None:
    """Return the file of `VecNormalize` that lies beside the zip at `path`; None: there is none. A file that is named
    after another zip in the same folder is that agent's."""
    name, zips = path.with_suffix(""), [one.stem for one in path.parent.glob("*.zip")]
    named = [file for folder in _folders(path) for file in sorted(folder.iterdir()) if _NAMED.search(file.name)]
    owners = {file: max((stem for stem in zips if file.name.startswith(stem)), key=len, default="") for file in named}
    checkpoint = re.sub(r"_(\d+_steps)$", r"_vecnormalize_\1", str(name))
    files = [Path(f"{name}.vecnormalize.pkl"), Path(f"{checkpoint}.pkl")]
    files += [file for file in named if file.parent != path.parent or path.stem.startswith(owners[file])]
    return next((file for file in files if file.is_file()), None)


def _folders(path: Path) -> list[Path]:
    """Return the folders that may hold what belongs to the zip at `path`: its own, one of its name, and one named as
    the task, where RL Zoo keeps that of Pendulum-v1_1/best_model.zip."""
    of_task = path.parent / re.sub(r"_\d+$", "", path.parent.resolve().name)
    return [folder for folder in (path.with_suffix(""), of_task, path.parent) if folder.is_dir()]


def _settings(path: Path, name: str) -> list[Path]:
    """Return the files of settings with this `name` that lie where `statistics_beside` looks for a zip at `path`."""
    files = [Path(f"{path.with_suffix('')}.{name}"), *(folder / name for folder in _folders(path))]
    return [file for one in files for file in (Path(f"{one}.yml"), Path(f"{one}.yaml")) if file.is_file()]


def sign(path: Path, saved: Saved) -> str:
    """Return what shows that the agent in the zip at `path` was trained on normalised observations; empty: nothing."""
    if beside := statistics_beside(path):
        return f"{beside} lies beside it"
    for settings in _settings(path, "config"):
        try:
            if any(_is_on(value) for value in _told(settings, "normalize")):
                return f"{settings} says so"
        except (OSError, ValueError, RecursionError) as error:
            return f"{settings} may say so, but cannot be read ({' '.join(str(error).split()):.80})"
    # An agent with a buffer, off policy, keeps them without a normalisation too
    if "buffer_size" not in saved.settings and saved.settings.get("_last_original_obs") is not None:
        return "it keeps observations from before a normalisation (_last_original_obs)"
    return ""


def trained_on(path: Path) -> str:
    """Return the environment that RL Zoo's args.yml beside the zip at `path` names; empty: it names none."""
    try:
        told = [str(value.value) for file in _settings(path, "args") for value in _told(file, "env")]
    except (OSError, ValueError, RecursionError):
        return ""
    return told[0] if told else ""


def _told(path: Path, name: str) -> list[Any]:
    """Return what a file of settings says of `name`, anywhere in it. Its YAML is read as plain nodes: nothing is built.
    Raises ValueError for a file that is not read whole."""
    import yaml  # here: few agents have such a file

    with open(path, "rb") as file:
        content = file.read(LARGEST_SETTINGS + 1)
    if len(content) > LARGEST_SETTINGS:
        raise ValueError(f"more than {LARGEST_SETTINGS} bytes")
    try:
        nodes: list = [*yaml.compose_all(content, Loader=yaml.SafeLoader)]
    except yaml.YAMLError as error:
        raise ValueError(error) from error
    found, seen = [], set()
    for node in nodes:  # which grows: mappings, and lists of pairs as the zoo writes them
        if id(node) in seen or not isinstance(node, yaml.CollectionNode):  # an alias may lead back
            continue
        seen.add(id(node))
        mapping = isinstance(node, yaml.MappingNode)
        pairs = node.value if mapping else [node.value] if len(node.value) == 2 else []
        nodes += [part for pair in node.value for part in pair] if mapping else node.value
        keys = [(key.value.strip().lower(), value) for key, value in pairs if isinstance(key, yaml.ScalarNode)]
        found += [value for key, value in keys if key == name]
    return found


def _is_on(value: Any) -> bool:
    """Whether a node asks for normalised observations: true, a mapping, or a text such as "dict(norm_obs=True)"."""
    import yaml

    text = str(value.value) if isinstance(value, yaml.ScalarNode) else yaml.serialize(value)
    off = text.strip().lower() in ("false", "no", "off", "null", "none", "~", "")
    return not off and not re.search(r"(?i)norm_obs['\"]?\s*[=:]\s*(false|no|off)\b", text)
