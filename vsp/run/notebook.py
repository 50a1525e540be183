"""nbformat, imported faster.

It imports jsonschema, which builds grammars of web addresses if it finds packages for them, as installed with
JupyterLab. This takes seconds, and the format of notebooks has no such addresses. These packages are hidden meanwhile.
"""

import sys

if hidden := {"rfc3987_syntax", "rfc3986_validator"} - sys.modules.keys():
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type] # None hides a module, says Python's reference
import nbformat
from nbformat import NotebookNode

for name in hidden:  # later imports by name find them
    del sys.modules[name]

__all__ = ["NotebookNode", "nbformat"]
