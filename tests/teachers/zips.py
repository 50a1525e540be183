"""Agents of Stable-Baselines3 and sb3-contrib, and zips of them with a part replaced."""

import base64
import collections
import dataclasses
import functools
import io
import json
import pickle
import zipfile

import gymnasium
import numpy as np
import pytest
from support import PENDULUM, SIMPLEGOAL

from vsp.tasks.registry import get_task

CAR = dataclasses.replace(  # limits of speed and steering are not symmetric
    get_task(PENDULUM), name="Car", action_low=np.array([0, -0.785]), action_high=np.array([5, 0.785])
)  # fmt: skip


class Car(gymnasium.Env):
    """Spaces and nothing else."""

    observation_space = gymnasium.spaces.Box(np.float32(CAR.low), np.float32(CAR.high))
    action_space = gymnasium.spaces.Box(np.float32(CAR.action_low), np.float32(CAR.action_high))


def made(algorithm, env=None, policy="MlpPolicy", *, random=True, about=None, **network):
    """An agent with these settings (`about`) and those of its policy, its tensors drawn anew."""
    import sb3_contrib
    import stable_baselines3
    import torch

    if isinstance(act := network.get("activation_fn"), str):
        network["activation_fn"] = getattr(torch.nn, act)
    kind = getattr(stable_baselines3, algorithm, None) or getattr(sb3_contrib, algorithm)
    model = kind(policy, env or SIMPLEGOAL, seed=0, device="cpu", policy_kwargs=network or None, **about or {})
    generator = torch.Generator().manual_seed(1)
    for name, tensor in model.policy.state_dict().items() if random else ():
        if tensor.dtype == torch.float32:
            tensor.uniform_(0.2 if name.endswith("ra_var") else -1.0, 1.0, generator=generator)
    return model


def in_float64(model, obs):
    """The actions of a model in float64: the library turns observations to float32, which here is float64."""
    import torch

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.Tensor, "float", torch.Tensor.double)
        model.policy.double()
        actions = model.predict(obs, deterministic=True)[0]
    model.policy.float()
    return actions


def rewritten(source, target, *, compression=zipfile.ZIP_DEFLATED, **parts):
    """A copy of a zip with some of its parts replaced (None: left out)."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", compression) as new:
        for name in old.namelist():
            content = parts.get(name.rpartition("/")[2].replace(".", "_"), old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def saved(content, **parts):
    """The bytes of `policy.pth` with `content`, as torch writes it, with some parts replaced."""
    import torch

    content = collections.OrderedDict(content) if isinstance(content, dict) else content  # as a policy's own
    torch.save(content, buffer := io.BytesIO())
    return rewritten(buffer, io.BytesIO(), **parts).getvalue()


def retold(source, target, tensors=lambda tensors: tensors, old=False, **settings):
    """A copy of a zip whose tensors went through a function, with other settings in JSON, or pickled if they are bytes.
    With `old`, torch's format before 1.6."""
    import torch

    with zipfile.ZipFile(source) as archive:
        data, policy = json.loads(archive.read("data")), torch.load(io.BytesIO(archive.read("policy.pth")))
    for name, value in settings.items():
        data[name] = {":serialized:": base64.b64encode(value).decode()} if isinstance(value, bytes) else value
    torch.save(tensors(policy), buffer := io.BytesIO(), _use_new_zipfile_serialization=not old)
    return rewritten(source, target, data=json.dumps(data).encode(), policy_pth=buffer.getvalue())


def bomb(wrap=lambda tuples: tuples):
    """A pickle of a tuple of tuples ... that would be 2 ** 90 values if it were printed or copied."""
    return pickle.dumps(wrap(functools.reduce(lambda value, _: (value, value), range(90), 1)))
