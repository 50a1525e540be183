"""nbformat, imported without what it does not need: seconds of every command that reads a notebook.

jsonschema, which nbformat asks, builds a whole grammar of international addresses if it finds `rfc3987_syntax`, which
JupyterLab brings, and does without it if not. No notebook's format has such an address.
"""

import sys

if hidden := "rfc3987_syntax" not in sys.modules:
    sys.modules["rfc3987_syntax"] = None
import nbformat  # noqa: E402
from nbformat import NotebookNode  # noqa: E402

if hidden:  # who asks for it by name shall find it
    del sys.modules["rfc3987_syntax"]

__all__ = ["NotebookNode", "nbformat"]
