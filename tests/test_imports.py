"""Who may import whom, and that no circle comes back."""

import ast
import functools
import importlib.util
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import vsp

ROOT = Path(vsp.__file__).parent
METHOD = {path.stem for path in ROOT.glob("[!_]*.py")}
BASIS = {"tasks", "subpolicies", "run"}
LAYERS = ["teachers", "baselines", "paper", "beyond", "course"]  # each may use those before it
MAY = dict.fromkeys(METHOD, METHOD | BASIS)
MAY |= {"tasks": {"checks"}, "subpolicies": {"checks", "tasks"}, "run": set()}
MAY |= {layer: METHOD | BASIS | set(LAYERS[:i]) for i, layer in enumerate(LAYERS)}
MAY |= {"show": METHOD | BASIS | {"teachers"}}
for wing in ("paper", "beyond", "course"):
    MAY[wing] |= {"show"}
MAY["teachers"] -= {"subpolicies"}


@functools.cache
def modules():
    return {".".join(("vsp", *path.relative_to(ROOT).with_suffix("").parts)): path for path in ROOT.rglob("*.py")}


def imported(name: str, path: Path) -> set[str]:
    """The modules of ours that a module imports anywhere but for types."""
    package = name.rpartition(".")[0]
    tree, found = ast.parse(path.read_text(encoding="utf-8")), set()
    for block in [one for one in ast.walk(tree) if isinstance(one, ast.If) and "TYPE_CHECKING" in ast.dump(one.test)]:
        block.body = [ast.Pass()]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.partition(".")[0] == "vsp"}
        elif isinstance(node, ast.ImportFrom):
            origin = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            if origin.partition(".")[0] == "vsp":
                parts = {f"{origin}.{alias.name}" for alias in node.names}
                found |= {part if part in modules() or f"{part}.__init__" in modules() else origin for part in parts}
    return {one if one in modules() else f"{one}.__init__" for one in found}


GRAPH = {name: imported(name, path) for name, path in modules().items()}


def test_the_rooms_are_there():
    assert len(METHOD) <= 11 and MAY.keys() - METHOD == {*BASIS, *LAYERS, "show"}
    assert len(GRAPH) > 60 and sum(map(len, GRAPH.values())) > 200


@pytest.mark.parametrize("room", sorted(MAY))
def test_a_room_imports_only_what_it_may(room):
    for name, others in GRAPH.items():
        if name.split(".")[1] == room:
            assert not {other for other in others if other.split(".")[1] not in MAY[room] | {room}}, name


def test_baselines_and_refinement_do_not_know_each_other():
    for one, other in (("vsp.baselines", "vsp.beyond"), ("vsp.beyond.refinement", "vsp.baselines")):
        assert not [
            name for name, others in GRAPH.items() if name.startswith(one) for o in others if o.startswith(other)
        ]


def test_no_circle():
    list(TopologicalSorter(GRAPH).static_order())
