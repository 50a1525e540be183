"""Who may import whom, that no circle comes back, and what `import vsp` loads."""

import ast
import importlib.util
import os
from graphlib import TopologicalSorter

import pytest
from support import python

from vsp.run.atomic import ROOT

PARTS = {"vsp": set(), "vsp_beyond": {"vsp"}, "studies": {"vsp", "vsp_beyond"}, "vsp_course": {"vsp", "vsp_beyond"}}

METHOD = {path.stem for path in (ROOT / "vsp").glob("[!_]*.py")}
BASIS = {"tasks", "subpolicies", "run"}
ROOMS = dict.fromkeys(METHOD, METHOD | BASIS)
ROOMS |= {"tasks": {"checks"}, "subpolicies": {"checks", "tasks"}, "run": set()}
ROOMS |= {"teachers": METHOD | BASIS - {"subpolicies"}, "show": METHOD | BASIS | {"teachers"}}
ROOMS |= {"protocol": METHOD | BASIS | {"teachers", "show"}}
ROOMS |= {"paper": METHOD | BASIS | {"teachers", "show", "protocol"}}

TREES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): ast.parse(path.read_text(encoding="utf-8"))
    for part in PARTS for path in (ROOT / part).rglob("*.py")
}  # fmt: skip


def imported(name: str, tree: ast.Module) -> set[str]:
    """The modules of ours that a module imports anywhere but for types."""
    package, names = name.rpartition(".")[0], set()
    nodes = list(ast.walk(tree))
    for_types = [node for node in nodes if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)]
    skipped = {part for block in for_types for part in block.body}
    for node in nodes:
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names if alias.name.partition(".")[0] in PARTS}
        elif isinstance(node, ast.ImportFrom):
            origin = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            if origin.partition(".")[0] in PARTS:
                parts = {f"{origin}.{alias.name}" for alias in node.names}
                names |= {part if part in TREES or f"{part}.__init__" in TREES else origin for part in parts}
    return {module if module in TREES else f"{module}.__init__" for module in names}


GRAPH = {name: imported(name, tree) for name, tree in TREES.items()}


@pytest.mark.parametrize("part", PARTS)
def test_a_part_imports_only_what_it_may(part):
    in_part = {name: others for name, others in GRAPH.items() if name.partition(".")[0] == part}
    assert in_part and not {
        (name, other) for name, others in in_part.items() for other in others
        if other.partition(".")[0] not in PARTS[part] | {part}
    }  # fmt: skip


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_a_room_of_the_paper_imports_only_what_it_may(room):
    for name, others in GRAPH.items():
        if name.split(".")[:2] == ["vsp", room]:
            assert not {other for other in others if other.split(".")[1] not in ROOMS[room] | {room}}, name


def test_no_circle():
    list(TopologicalSorter(GRAPH).static_order())


def test_importing_vsp_loads_the_method_alone_and_no_part_loads_torch():
    """In a process of its own, so that no other test has imported a part before."""
    code = """
import sys, vsp
print(*sys.modules)
import gymnasium
gymnasium.make("SimpleGoal-v0")
vsp.paper.published_policy("SimpleGoal-v0").predict([0.5, 0.5])
vsp.load_teacher("SimpleGoal-v0"), vsp.show.panels, vsp.paper.baselines.linear_map
import studies.comparison, vsp_beyond, vsp_course
print(*sys.modules)
"""
    said = python(code, env=os.environ | {"PYTHONWARNINGS": "error"})
    by_vsp, by_all = (line.split() for line in said.splitlines())
    tops = {name.partition(".")[0] for name in by_vsp}
    assert not tops & {"pandas", "sklearn", "matplotlib", "torch", "stable_baselines3", *PARTS.keys() - {"vsp"}}
    assert len([name for name in by_vsp if name.partition(".")[0] == "vsp"]) <= 36
    assert not {"torch", "stable_baselines3"} & set(by_all)
