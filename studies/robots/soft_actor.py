"""Cells and trees as differentiable actors: soft borders while they learn and in the critics' targets, hard ones when
they act. Imports torch."""

import torch

from vsp_beyond.few_cells.units import ScaledCells, Scaling, parted

CLIP_SLOPE = 0.02  # slope beyond the action limits in training: without it, a saturated map stays saturated


class SoftActor(torch.nn.Module):
    """Policies made of linear maps, in the units of a `Scaling`, as the network that TD3 trains. `numbers`:
    `ScaledCells`, or a `TunableTree` with oblique borders. Observations (n, d) to actions (n, m) in [-1, 1]."""

    def __init__(self, frame: Scaling, numbers, temperature: float):
        super().__init__()
        self._numbers, self._temperature = numbers, temperature
        self.vector = torch.nn.Parameter(torch.tensor(numbers.vector, dtype=torch.float32))
        for name, value in (("centre", frame.centre), ("scale", frame.scale)):
            self.register_buffer(name, torch.tensor(value, dtype=torch.float32))
        self._closeness = _to_codewords if isinstance(numbers, ScaledCells) else _to_leaves

    @property
    def numbers(self):
        """The learned numbers, of the same kind as the initial ones."""
        return self._numbers.like(self.vector.detach().double().numpy())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the actions of the nearest piece; during training, of all pieces, in shares that fall with the
        distance."""
        states = (observations - self.centre) / self.scale
        parts: list[torch.Tensor] = parted(self.vector, self._numbers.parts)
        *places, maps = parts
        closeness = self._closeness(states, places, self._numbers)  # (n, k)
        k, rows, m = maps.shape
        inputs = torch.cat([states, torch.ones(len(states), 1)], dim=1)
        raw = (inputs @ maps.permute(1, 0, 2).reshape(rows, k * m)).reshape(-1, k, m)
        limited = raw.clamp(-1.0, 1.0)
        if not self.training:
            return limited[torch.arange(len(states)), closeness.argmax(dim=1)]
        shares = torch.softmax(closeness / self._temperature, dim=1)
        return (shares[:, :, None] * (limited + CLIP_SLOPE * (raw - limited))).sum(dim=1).clamp(-1.0, 1.0)


def _to_codewords(states: torch.Tensor, places: list[torch.Tensor], numbers: ScaledCells) -> torch.Tensor:
    """Return how near each codeword is, as in `ScaledCells.closeness`. (n, k)"""
    (codewords,) = places
    return 2 * states @ codewords.T - codewords.square().sum(dim=1)


def _to_leaves(states: torch.Tensor, places: list[torch.Tensor], numbers) -> torch.Tensor:
    """Return how near each state is to each leaf: 0 for the leaf that it is in, else minus twice the sum of its
    distances to those borders on the way to the leaf of which it is on the wrong side. (n, k)"""
    directions, thresholds = places
    sides = torch.tensor(numbers.sides, dtype=torch.float32)  # (k, nodes)
    beyond = states @ directions.T - thresholds  # (n, nodes)
    wrong = torch.relu(-beyond) @ sides.clamp(min=0).T + torch.relu(beyond) @ (-sides).clamp(min=0).T
    return -2 * wrong
