"""The network that flew, from a reader's own copy of `actor.h`: parsed as text, never compiled.

The file lies at github.com/arplaboratory/learning_to_fly_controller, `data/actor.h`. It has no licence, so neither it
nor anything fitted to it is part of this project.
"""

import hashlib
import os
import re
from pathlib import Path

import numpy as np

from .quadrotor import see_all

LARGEST = 2**21  # bytes of the file
ARRAY = re.compile(r"const unsigned char memory\[\] = \{([0-9, ]{1,400000})\};")
SIZES = (64 * 146, 64, 64 * 64, 64, 4 * 64, 4, 146, 4)  # weights and biases of three layers; inputs and their output
EXACT = 1e-6  # of the file's own test


class Flown:
    """The network of the file at `path`: `command(states)` flies, `digest` is the SHA-256 of the file.

    Raises ValueError unless the file holds three layers of these sizes, finite, and its own test comes out."""

    def __init__(self, path: str | os.PathLike):
        with Path(path).open("rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise ValueError(f"{path} has more than {LARGEST:,} bytes, expected about 264,000")
        self.digest = hashlib.sha256(data).hexdigest()
        texts = ARRAY.findall(data.decode("ascii", "replace"))
        arrays = [np.frombuffer(_bytes(text, path), "<f4") for text in texts]
        sizes = tuple(array.size for array in arrays)
        if sizes != SIZES:
            raise ValueError(f"{path} holds arrays of {str(sizes):.100} numbers, expected {SIZES}")
        if not all(np.isfinite(array).all() for array in arrays):
            raise ValueError(f"{path} holds numbers that are not finite")
        *parts, inputs, outputs = arrays
        self.layers = [(weight.reshape(len(bias), -1).T, bias) for weight, bias in zip(parts[::2], parts[1::2])]
        error = float(np.abs(self.outputs(inputs) - outputs).max())
        if not error <= EXACT:  # NaN neither
            raise ValueError(f"{path}: the network misses its own test by {error:.2g}, expected at most {EXACT}")

    @property
    def numbers(self) -> int:
        """How many weights and biases act."""
        return sum(weight.size + bias.size for weight, bias in self.layers)

    def outputs(self, inputs: np.ndarray) -> np.ndarray:
        """Return the commands (n, 4) at all 146 inputs (n, 146), in float32."""
        hidden = inputs.astype(np.float32)
        for weight, bias in self.layers:
            hidden = np.clip(hidden @ weight + bias, -3, 3)
            hidden = hidden * (27 + hidden**2) / (27 + 9 * hidden**2)  # the firmware's tanh
        return hidden

    def command(self, states: np.ndarray) -> np.ndarray:
        """Return the commands (n, 4) in states with a history (n, 149)."""
        return self.outputs(see_all(states)).astype(np.float64)


def _bytes(text: str, path: str | os.PathLike) -> bytes:
    values = [int(value) for value in text.split(",")]
    if max(values) > 255 or len(values) % 4:
        raise ValueError(f"{path} holds an array that is no float32")
    return bytes(values)
