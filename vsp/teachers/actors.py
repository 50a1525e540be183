"""The networks of Stable-Baselines3 and sb3-contrib that a `Teacher` can be, from what a zip says of its agent.

All are layers with one activation between them. `POLICIES` has the policy classes by name. What a zip says beyond that,
a setting, a class or a tensor, is refused by name: it might act.
"""

import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..checks import check_array, check_finite
from .inert import Thing, Unfit, Unknown, array

if TYPE_CHECKING:
    from ..tasks.base import Task
    from .agent_zip import Saved

MOST_WEIGHT = 1e6  # largest absolute value in a tensor, so that 3 layers of 1000 units stay far below float32's 3e38


def _gelu(x: np.ndarray) -> np.ndarray:
    from scipy.special import erf  # here: most teachers have no use for it

    return 0.5 * x * (1 + erf(x / np.sqrt(x.dtype.type(2))))


ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {  # torch's, with its default constants
    "ReLU": lambda x: np.maximum(x, 0.0),
    "Tanh": np.tanh,
    "ELU": lambda x: np.where(x > 0, x, np.expm1(np.minimum(x, 0))),
    "LeakyReLU": lambda x: np.where(x > 0, x, x.dtype.type(0.01) * x),
    "GELU": _gelu,
    "SiLU": lambda x: x / (1 + np.exp(-np.maximum(x, -80.0))),
}


class Actor(NamedTuple):
    """A network: layers of weights (inputs, outputs) and biases (outputs,), with `activation` between them."""

    layers: list[tuple[np.ndarray, np.ndarray]]  # of `layers_of`
    activation: str = "ReLU"
    squashed: bool = True  # the output passes through tanh to the action box; else it is limited to the box
    clip_mean: float = np.inf  # limits the output before tanh, as state-dependent exploration does

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """Return the outputs (n, m) at the inputs (n, d) in float32; in [-1, 1] if squashed."""
        hidden, act = inputs, ACTIVATIONS[self.activation]
        for weight, bias in self.layers[:-1]:
            hidden = act(hidden @ weight + bias)
        weight, bias = self.layers[-1]
        outputs = np.clip(hidden @ weight + bias, -self.clip_mean, self.clip_mean)
        return np.tanh(outputs) if self.squashed else outputs


class Kind(NamedTuple):
    """A kind of policy: the networks that act, in their order, and what its class leaves at its default."""

    networks: tuple[str, ...]
    activation: str
    squashed: bool
    others: str  # pattern of the tensors that do not act


_SAC = Kind(("actor.latent_pi", "actor.mu"), "ReLU", True, r"critic\.|actor\.log_std\b|actor\.sde_features_extractor\.")
_PPO = Kind(("mlp_extractor.shared_net", "mlp_extractor.policy_net", "action_net"), "Tanh", False,
            r"mlp_extractor\.value_net\.|value_net\.|log_std\b|sde_features_extractor\.")  # fmt: skip
_ARS = Kind(("action_net",), "ReLU", True, r"$^")
_LINEAR = _ARS._replace(squashed=False)
POLICIES = {
    "stable_baselines3.td3.policies.TD3Policy": Kind(("actor.mu",), "ReLU", True, r"critic\."),  # also DDPG's
    "stable_baselines3.sac.policies.SACPolicy": _SAC,
    "sb3_contrib.tqc.policies.TQCPolicy": _SAC,
    "sb3_contrib.crossq.policies.CrossQPolicy": _SAC,
    "stable_baselines3.common.policies.ActorCriticPolicy": _PPO,  # of PPO, A2C and TRPO
    "sb3_contrib.ars.policies.ARSPolicy": _ARS,
    "sb3_contrib.ars.policies.ARSLinearPolicy": _LINEAR,
}
# Settings of a policy that its tensors show, or that serve training or exploration only
_HARMLESS = set(
    """net_arch n_critics n_quantiles log_std_init ortho_init full_std use_expln sde_net_arch optimizer_class
    optimizer_kwargs share_features_extractor normalize_images with_bias batch_norm batch_norm_momentum
    renorm_warmup_steps device""".split()
)
_FLATTEN = "stable_baselines3.common.torch_layers.FlattenExtractor"  # does nothing to an observation of one dimension


def actor_of(saved: "Saved") -> Actor:
    """Return the network that acts. Raises Unknown, by name, for anything that is not modelled here."""
    policy = saved.setting("policy_class")
    name = policy.name if isinstance(policy, Thing) and policy.given is None else "one that only its own code can build"
    if "recurrent" in name.lower():
        raise Unfit(f"its policy class is {name:.100}, which keeps a memory between steps: train one without")
    if name not in POLICIES:
        known = sorted(known.rpartition(".")[2] for known in POLICIES)
        raise Unknown(f"its policy class is {name:.100}, expected one of {', '.join(known)}")
    kind, settings = POLICIES[name], _policy_settings(saved)
    for name, value in settings.items():
        if name == "features_extractor_class" and isinstance(value, Thing) and value.name == _FLATTEN:
            continue
        if name == "features_extractor_kwargs" and not value or name in _HARMLESS:
            continue
        if name not in ("activation_fn", "use_sde", "squash_output", "clip_mean", "batch_norm_eps"):
            raise Unknown(f"its policy has {name:.100} = {_shown(value):.100}")
    for name in saved.tensors:
        acts = any(re.fullmatch(rf"{re.escape(network)}\.(\d+\.)?\w+", name) for network in kind.networks)
        if not acts and not re.match(kind.others, name):
            raise Unknown(f"its policy has the tensor {name:.100}")
    biased, epsilon = "action_net" != kind.networks[0], _number(settings, "batch_norm_eps", 0.001)
    activation = _activation(settings, kind)
    layers = layers_of(saved.tensors, *kind.networks, epsilon=epsilon, biased=biased)
    told, found = _units(settings.get("net_arch")), [len(bias) for _, bias in layers[:-1]]
    told_of = "net_arch says otherwise" if told is not None else "without net_arch its class makes 2, a linear one none"
    if told != found if told is not None else len(found) != 2 * (kind is not _LINEAR):
        raise Unknown(f"its tensors make hidden layers of {str(found):.100} units, {told_of}")
    exploring = bool(_number(settings if "use_sde" in settings else saved.settings, "use_sde", False))
    squashed = bool(_number(settings, "squash_output", kind.squashed)) and (exploring or kind is not _PPO)
    clip = _number(settings, "clip_mean", 2.0) if kind is _SAC and exploring else 0.0
    if (clip > 0) != ("actor.mu.0.weight" in saved.tensors and kind is _SAC):
        raise Unknown(f"clip_mean is {clip}, but its tensors say otherwise")
    return Actor(layers, activation, squashed, clip if clip > 0 else np.inf)


def _policy_settings(saved: "Saved") -> dict:
    found = saved.setting("policy_kwargs")
    found = found.items if isinstance(found, Thing) and found.name == "collections.OrderedDict" else found or {}
    if not isinstance(found, dict):
        raise Unknown(f"its policy_kwargs are {_shown(found):.100}, expected a dictionary")
    return {str(name): value for name, value in found.items()}


def _units(net_arch: Any) -> list[int] | None:
    """Return the widths of the actor's hidden layers; None if they are not told. The last of a list may be a dictionary
    of what the actor ("pi") and the critic have by themselves."""
    match net_arch:
        case dict():
            return _units(net_arch.get("pi"))
        case [*shared, dict() as rest]:
            return [*shared, *(_units(rest) or [])]
        case [*found] if all(isinstance(width, int) for width in found):
            return found
        case None:
            return None
    raise Unknown(f"net_arch is {_shown(net_arch):.100}, expected lists of numbers")


def _shown(value: object) -> str:
    """Return a value as text; of what holds others, which may never end, the name alone."""
    if isinstance(value, Thing):
        return value.name
    return repr(value) if isinstance(value, str | int | float | None) else f"a {type(value).__name__}"


def _number(settings: dict, name: str, default: float) -> float:
    """Return a number or truth value of the settings. Raises Unknown for anything else."""
    return float(array(settings.get(name, default), name))


def _activation(settings: dict, kind: Kind) -> str:
    named = settings.get("activation_fn")
    if named is None:
        return kind.activation
    module, _, name = _shown(named).rpartition(".")
    plain = isinstance(named, Thing) and named.given is None and module == "torch.nn.modules.activation"
    if not plain or name not in ACTIVATIONS:
        raise Unknown(f"its activation is {_shown(named):.100}, expected one of {', '.join(ACTIVATIONS)}")
    return name


def part_of(tensors: dict, part: str) -> dict:
    """Return the tensors of an agent's "actor" or "critic", without this beginning of their names."""
    return {name.removeprefix(f"{part}."): value for name, value in tensors.items() if name.startswith(f"{part}.")}


def layers_of(
    tensors: dict[str, np.ndarray], *networks: str, epsilon: float = 0.001, biased: bool = True
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the layers of these networks in float32, one after the other; batch normalisation is merged into the next.
    A layer may lack its bias unless `biased`. Raises Unknown for a module that is neither, and ValueError for layers
    that do not fit each other and for numbers that are not finite or beyond `MOST_WEIGHT`."""
    layers: list[tuple[np.ndarray, np.ndarray]] = []
    shift, scale = np.zeros(1), np.ones(1)
    for module, parts in (found for network in networks for found in _modules(tensors, network)):
        if {*parts} == {"ra_mean", "ra_var", "scale", "bias", "steps"}:
            for part in ("ra_mean", "ra_var", "bias"):
                check_array(f"{module}.{part}", parts[part], (parts["scale"].size,))
            with np.errstate(all="ignore"):  # the check below refuses what comes of it
                scale = parts["scale"] / np.sqrt(parts["ra_var"] + epsilon)
            shift = parts["bias"] - parts["ra_mean"] * scale
            continue
        if {*parts} != {"weight", "bias"} and (biased or {*parts} != {"weight"}):
            raise Unknown(f"{module} has the tensors {', '.join(sorted(parts))}, expected a weight and a bias")
        inputs = len(layers[-1][1]) if layers else -1
        weight = check_array(f"{module}.weight", parts["weight"], (-1, inputs)).T
        bias = check_array(f"{module}.bias", parts.get("bias", np.zeros(weight.shape[1])), weight.shape[1:])
        weight, bias = scale[:, None] * weight, bias + np.broadcast_to(shift, len(weight)) @ weight
        for part in (weight, bias):
            check_array(module, part, part.shape, most=MOST_WEIGHT)
        layers.append((weight.astype(np.float32, order="C"), bias.astype(np.float32)))  # the order fixes the sums
        shift, scale = np.zeros(1), np.ones(1)
    if not layers or scale.shape != (1,):
        raise Unknown("there is no layer, or normalisation is the last: expected a layer at the end")
    return layers


def _modules(tensors: dict[str, np.ndarray], network: str) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Return the modules of a network in their order, each with its tensors by the ends of their names."""
    modules: dict[str, dict[str, np.ndarray]] = {}
    for name in tensors:
        if match := re.fullmatch(rf"{re.escape(network)}\.(?:\d+\.)?(\w+)", name):
            tensor, most = check_finite(name, tensors[name]), np.inf if match[1] == "steps" else MOST_WEIGHT
            part = check_array(name, tensor, tensor.shape, most=most)
            modules.setdefault(name.removesuffix(f".{match[1]}"), {})[match[1]] = part
    found = sorted(modules.items(), key=lambda item: int(re.sub(r"\D", "", item[0].removeprefix(network)) or 0))
    normalised = any("scale" in parts for parts in modules.values())  # before each layer and at the end
    places = [3 * i // 2 if normalised else 2 * i for i in range(len(found))]
    expected = [(f"{network}.{place}", normalised and i % 2 == 0) for i, place in enumerate(places)]
    if [(name, "scale" in parts) for name, parts in found] not in (expected, [(network, False)]):
        names = [", ".join(name for name, _ in some) for some in (found, expected)]
        raise Unknown(f"its modules are {names[0]:.200}, expected {names[1]:.200}")
    return found


def check_spaces(found: Callable[[str], Any], task: "Task") -> None:
    """Raise Unfit unless an agent's "observation_space" and "action_space", which `found` returns as descriptions or
    spaces, are the boxes of the task. Observations without limits fit any, with a warning: some environments had none
    in older versions, but a wrapper that changes observations may have taken the limits away, too."""
    boxes = {"observation_space": (task.low, task.high), "action_space": (task.action_low, task.action_high)}
    for name, ours in boxes.items():
        space, free = found(name), name == "observation_space"
        theirs = _limits(space, name)
        if not theirs[0].shape == theirs[1].shape == ours[0].shape:
            shapes = [" x ".join(map(str, limits.shape)) or "1" for limits in (theirs[0], ours[0])]
            text = f"its {name} has {shapes[0]} numbers, {task.name} has {shapes[1]}"
            raise Unfit(f"{text}: name the task that it was trained for")
        for limit, of_it, of_task in zip(("low", "high"), theirs, ours):
            if not (np.isclose(of_it, of_task, rtol=1e-5) | (np.isinf(of_it) & free)).all():
                text = f"{limit} of its {name} is {of_it.tolist()!s:.200}, {task.name} has {of_task.tolist()!s:.200}"
                raise Unfit(f"{text}: name the task that it was trained for")
            if (np.isinf(of_it) & np.isfinite(of_task)).any():
                text = f"the agent's observations have no limits, those of {task.name} have: if a wrapper such as "
                warnings.warn(f"{text}NormalizeObservation changed them, pass normalize=(mean, variance)", stacklevel=4)


def _limits(space: Any, name: str) -> list[np.ndarray]:
    """Return low and high of a box, which a pickle describes or Gymnasium made. Raises Unfit for another space."""
    described = isinstance(space, Thing)
    kind = space.name.rpartition(".")[2] if described else type(space).__name__
    parts = (space.state if described else vars(space)) if kind == "Box" else None
    if not isinstance(parts, dict):
        said = "missing" if space is None else f"{kind:.60}"
        raise Unfit(f"its {name} is {said}, expected a Box: wrap the agent, vsp.agent(lambda obs: ..., name=...)")
    limits = [parts.get(limit) for limit in ("low", "high")]
    return [one if isinstance(one, np.ndarray) else array(one, f"a limit of its {name}") for one in limits]
