"""Code that only sets up, draws or lists is folded away; code that makes the argument stays open."""

import re

from docutils import nodes

_DRAWS = re.compile(r"\bsave_figure\(")
_LISTS = re.compile(r"\b(save_table|show_table)\(")
_ARGUES = re.compile(r"\b(distill|simplify|explain|prove|explore|Laboratory|split_regions|merge_regions)\(")
_READS = re.compile(r"\b(all_rows|read_rows|read_results|paper_results)\(")
_SETS_UP = re.compile(r"^(out = |import |from )", re.MULTILINE)


def kind(code: str) -> str | None:
    """What folded code does, in words; None for code that stays open."""
    if _ARGUES.search(code):
        return None
    if _DRAWS.search(code):
        return "draws the figure"
    if _LISTS.search(code):
        return "makes the table"
    if _READS.search(code):
        return "reads the results"
    return "settings and imports" if _SETS_UP.search(code) else None


def _fold(app, doctree, docname):
    """Wrap the input of such cells into `details`; lessons are there to be read whole."""
    if not re.match(r"notebooks/\d", docname):
        return
    for box in list(doctree.findall(nodes.container)):
        if "cell_input" in box["classes"] and (what := kind(box.astext())):
            summary = f'<details class="code"><summary>code: {what}</summary>'
            parent, at = box.parent, box.parent.index(box)
            parent.insert(at + 1, nodes.raw("", "</details>", format="html"))
            parent.insert(at, nodes.raw("", summary, format="html"))


def setup(app):
    app.connect("doctree-resolved", _fold)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
