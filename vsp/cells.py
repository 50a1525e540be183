"""`Cells`: where the maps of a policy are valid. The paper's cells are `Nearest`, those of a tree `Halfspaces`.

A policy is cells and maps (`policy.PiecewisePolicy`). To draw cells in another way, write a class with the methods of
`Cells`, in any file.
"""

import json
from typing import Any, Protocol

import numpy as np

from . import geometry
from .checks import check_array
from .geometry import Metric, metric_of
from .subpolicies.base import combination, number

MOST, LEAST_SCALE = 1e50, 1e-50  # limits of a policy's numbers, which keep squared distances and products below 1e308


class Cells(Protocol):
    """k cells that fill the space of the states (d,), numbered from 0. Methods do not check states.

    A file of the policy holds `arrays` and `options`, from which the class makes the same cells:
    `Class(**arrays, **options)`. `valid` ends the sentence "each map is valid ..."; `column` heads a table of cells."""

    d: int
    valid: str
    column: str
    arrays: dict[str, np.ndarray]
    options: dict[str, Any]

    def __len__(self) -> int: ...

    def locate(self, states: np.ndarray) -> np.ndarray:
        """Cell of each state (n, d). (n,)"""

    def border(self, state: np.ndarray, cell: int) -> tuple[int | None, float]:
        """The other cell that is the nearest to a state (d,) in `cell`, and how far its border is; None and inf if
        there is no other."""

    def about(self, inputs: tuple[str, ...], digits: int | None) -> str:
        """What holds for all cells, such as the distance; empty if nothing does."""

    def place(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """Where a cell lies, in words, with the names of the inputs."""

    def latex(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """Where a cell lies, in LaTeX; the names of the inputs are in LaTeX, too."""

    def python(self) -> list[str]:
        """Lines of Python that define `locate(state)`, for a state of finite numbers."""

    def c(self) -> str:
        """C99 code that defines `static int locate(const double *state)`, for a state of finite numbers."""


class Nearest:
    """The cells around codewords (k, d): a state belongs to the nearest, the lowest index if several are as near.

    Distances are taken between states divided by `scale` (d,); None: raw states. Raises ValueError for wrong shapes,
    equal codewords, and numbers that are not finite or beyond the limits `MOST` and `LEAST_SCALE`."""

    valid, column = "where its codeword is the nearest", "codeword"

    def __init__(self, codewords: np.ndarray, metric: str | Metric = geometry.LOOKUP, scale: np.ndarray | None = None):
        self.codewords = check_array("codewords", codewords, (-1, -1), most=MOST).copy()
        self.d = self.codewords.shape[1]
        self.scale = check_array("scale", np.ones(self.d) if scale is None else scale, (self.d,), most=MOST).copy()
        self.metric = metric_of(metric)
        if not len(self.codewords) or not geometry.all_differ(self.codewords):
            raise ValueError(f"expected at least one codeword and all different, got {self.codewords.tolist()}")
        if not (self.scale >= LEAST_SCALE).all():
            raise ValueError(f"scale is {self.scale.tolist()}, expected positive numbers of at least {LEAST_SCALE}")
        self._scaled = self.codewords / self.scale
        for array in (self.codewords, self.scale):  # an edit would not reach the look-up
            array.setflags(write=False)
        self.arrays = {"scale": self.scale, "codewords": self.codewords}
        self.options = {"metric": self.metric.name}

    def __len__(self) -> int:
        return len(self.codewords)

    def locate(self, states: np.ndarray) -> np.ndarray:
        """Cell of each state (n, d). (n,)"""
        return geometry.look_up(self._scaled, states / self.scale, self.metric)

    def border(self, state: np.ndarray, cell: int) -> tuple[int | None, float]:
        """The cell with the second nearest codeword, and the distance to it minus that to the nearest."""
        if len(self) == 1:
            return None, np.inf
        gaps = geometry.distances((state / self.scale)[None], self._scaled, self.metric)[0]
        other = int(gaps.argsort(kind="stable")[1])
        return other, float(gaps[other] - gaps[cell])

    def place(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """The codeword in words: "nearest to x 0.5, y 0.3"."""
        return f"nearest to {', '.join(f'{name} {number(c, digits)}' for name, c in zip(inputs, self.codewords[cell]))}"

    def latex(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """The codeword between dollar signs."""
        return "$[" + ",\\ ".join(number(c, digits) for c in self.codewords[cell]) + "]$"

    def about(self, inputs: tuple[str, ...], digits: int | None) -> str:
        """Name the distance to the codewords: "Euclidean distances of states divided, x by 0.3, y by 0.2"."""
        units = (f"{name} by {number(unit, digits)}" for name, unit in zip(inputs, self.scale))
        of_scaled = "" if (self.scale == 1).all() else f" of states divided, {', '.join(units)}"
        return f"{self.metric.name.capitalize()} distances{of_scaled}"

    def python(self) -> list[str]:
        """Lines of Python that define `locate(state)`. Raises ValueError for a metric without code."""
        term, root = self.metric.code
        return [
            f"SCALE = {self.scale.tolist()}",
            f"CODEWORDS = {self._scaled.tolist()}",
            "",
            "",
            "def locate(state):",
            '    """Index of the nearest codeword."""',
            "    point, distances = [s / unit for s, unit in zip(state, SCALE)], []",
            "    for codeword in CODEWORDS:",
            "        gaps = [a - b for a, b in zip(point, codeword)]",
            f"        distance = {'max' if self.metric.order == np.inf else 'sum'}({term} for gap in gaps)",
            f"        distances.append({root})",
            "    return distances.index(min(distances))",
        ]

    def c(self) -> str:
        """C99 code that defines `locate`. Raises ValueError for a metric without code."""
        (k, d), (term, root) = self.codewords.shape, self.metric.code
        add = f"if ({term} > distance) distance = {term};" if self.metric.order == np.inf else f"distance += {term};"
        root = "" if root == "distance" else f"        distance = {root};\n"
        return f"""static const double scale[{d}] = {braces(self.scale)};
static const double codewords[{k}][{d}] = {braces(self._scaled)};

/* The index of the nearest codeword. */
static int locate(const double *state) {{
    int nearest = 0;
    double least = (double)INFINITY;
    for (int i = 0; i < {k}; i++) {{
        double distance = 0.0;
        for (int j = 0; j < {d}; j++) {{
            double gap = state[j] / scale[j] - codewords[i][j];
            {add}
        }}
{root}        if (distance < least) {{
            least = distance;
            nearest = i;
        }}
    }}
    return nearest;
}}
"""


class Halfspaces:
    """The cells of a tree whose nodes are hyperplanes: those of a model tree, or of support vector machines.

    A state x is beyond node s if `normals[s] @ x > thresholds[s]`; it goes on to `children[s, 1]`, else to
    `children[s, 0]`: a later node, or a cell c written as -1 - c. Node 0 is the root; without nodes there is one cell.
    Raises ValueError for wrong shapes, numbers beyond `MOST`, and children that are not a tree."""

    valid, column = "in one cell of a tree of half-spaces", "cell"
    options: dict[str, Any] = {}

    def __init__(self, normals: np.ndarray, thresholds: np.ndarray, children: np.ndarray):
        self.normals = check_array("normals", normals, (-1, -1), most=MOST).copy()
        (s, self.d), self._k = self.normals.shape, len(self.normals) + 1
        self.thresholds = check_array("thresholds", thresholds, (s,), most=MOST).copy()
        self.children = check_array("children", children, (s, 2)).astype(np.int64)
        expected = [*range(-self._k, 0), *range(1, s)] if s else []
        later = (self.children < 0) | (self.children > np.arange(s)[:, None])
        if sorted(self.children.ravel().tolist()) != expected or not later.all():
            raise ValueError(f"children are {self.children.tolist()}, expected each later node and each cell once")
        if not self.normals.any(axis=1).all():
            raise ValueError("a normal is zero, expected hyperplanes")
        self.arrays = {"normals": self.normals, "thresholds": self.thresholds, "children": self.children}

    def __len__(self) -> int:
        return self._k

    def locate(self, states: np.ndarray) -> np.ndarray:
        """Cell of each state (n, d). (n,)"""
        nodes = np.full(len(states), 0 if self._k > 1 else -1)
        for s, children in enumerate(self.children):  # parents come before their children
            here = np.flatnonzero(nodes == s)
            nodes[here] = children[(states[here] @ self.normals[s] > self.thresholds[s]).astype(int)]
        return -1 - nodes

    def way(self, cell: int) -> list[tuple[int, int]]:
        """Nodes from the root to a cell, with the side that leads there: 1 beyond the hyperplane, else 0."""
        way, node = [], -1 - cell
        while self._k > 1 and node != 0:
            ((node, side),) = np.argwhere(self.children == node).tolist()
            way.append((node, side))
        return way[::-1]

    def border(self, state: np.ndarray, cell: int) -> tuple[int | None, float]:
        """The cell beyond the nearest hyperplane of a cell, and the distance to it in the units of the states."""
        if self._k == 1:
            return None, np.inf
        nodes, sides = np.array(self.way(cell)).T
        normals, lengths = self.normals[nodes], np.linalg.norm(self.normals[nodes], axis=1)
        gaps = (self.thresholds[nodes] - normals @ state) / lengths
        i = int(np.abs(gaps).argmin())
        push = (1 - 2 * sides[i]) * 1e-9 * (1 + np.abs(state).max())  # a little beyond the hyperplane
        beyond = state + (gaps[i] + push) * normals[i] / lengths[i]
        return int(self.locate(beyond[None])[0]), float(abs(gaps[i]))

    def about(self, inputs: tuple[str, ...], digits: int | None) -> str:
        """Nothing: each cell has its own half-spaces."""
        return ""

    def place(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """The half-spaces that meet in a cell: "where 0.5 x - 1.2 v <= 0.3 and x > 0.1"."""
        return f"where {' and '.join(self._sides(cell, inputs, digits, ('<=', '>'))) or 'the state is'}"

    def latex(self, cell: int, inputs: tuple[str, ...], digits: int | None) -> str:
        """The half-spaces that meet in a cell, between dollar signs."""
        return (
            "$" + ",\\ ".join(self._sides(cell, inputs, digits, ("\\le", ">"))) + "$" if self._k > 1 else "all states"
        )

    def _sides(self, cell: int, inputs: tuple[str, ...], digits: int | None, signs: tuple[str, str]) -> list[str]:
        return [
            f"{combination(self.normals[s], inputs, digits)} {signs[side]} {number(self.thresholds[s], digits)}"
            for s, side in self.way(cell)
        ]

    def python(self) -> list[str]:
        """Lines of Python that define `locate(state)`."""
        return [
            *(f"{name.upper()} = {array.tolist()}" for name, array in self.arrays.items()),
            "",
            "",
            "def locate(state):",
            '    """Index of the cell, found from the root of the tree on."""',
            f"    node = {0 if self._k > 1 else -1}",
            "    while node >= 0:",
            "        place = sum(n * s for n, s in zip(NORMALS[node], state))",
            "        node = CHILDREN[node][int(place > THRESHOLDS[node])]",
            "    return -1 - node",
        ]

    def c(self) -> str:
        """C99 code that defines `locate`."""
        if self._k == 1:
            return "static int locate(const double *state) {\n    return state ? 0 : 0;\n}\n"
        s, d = self.normals.shape
        return f"""static const double normals[{s}][{d}] = {braces(self.normals)};
static const double thresholds[{s}] = {braces(self.thresholds)};
static const int children[{s}][2] = {braces(self.children)};

/* The index of the cell, found from the root of the tree on. */
static int locate(const double *state) {{
    int node = 0;
    while (node >= 0) {{
        double place = 0.0;
        for (int j = 0; j < {d}; j++) place += normals[node][j] * state[j];
        node = children[node][place > thresholds[node]];
    }}
    return -1 - node;
}}
"""


CELLS = {"Nearest": Nearest, "Halfspaces": Halfspaces}  # by the name in a file


def braces(values: np.ndarray) -> str:
    """Write an array as C does."""
    return json.dumps(values.tolist()).replace("[", "{").replace("]", "}")
