"""Code of notebooks: what only sets up, draws or lists is folded away, what makes the argument stays open.

The search does not find it: who asks what a cell is does not mean a loop over `cells`.
"""

import re

from docutils import nodes

_AIDS = re.compile(r"\b(save_figure|save_table|show_table|all_rows|read_rows|read_results|paper_results)\(")
_ARGUES = re.compile(r"\b(distill|simplify|explain|prove|explore|Laboratory|split_regions|merge_regions)\(")
_SETS_UP = re.compile(r"^(out = |import |from )", re.MULTILINE)


def is_folded(code: str) -> bool:
    """Whether `code` only sets up, reads, draws or lists."""
    return not _ARGUES.search(code) and bool(_AIDS.search(code) or _SETS_UP.search(code))


def _fold(app, doctree, docname):
    """Wrap the input of such cells into `details`; lessons are there to be read whole."""
    for box in list(doctree.findall(nodes.container)) if docname.startswith("notebooks/") else ():
        if "cell_input" not in box["classes"]:
            continue
        box["classes"].append("no-search")
        if re.match(r"notebooks/\d", docname) and is_folded(box.astext()):
            parent, at = box.parent, box.parent.index(box)
            parent.insert(at + 1, nodes.raw("", "</details>", format="html"))
            parent.insert(at, nodes.raw("", '<details class="code"><summary>code</summary>', format="html"))


def setup(app):
    app.connect("doctree-resolved", _fold)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
