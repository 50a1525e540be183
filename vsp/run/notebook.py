"""nbformat and nbclient for every command that reads or runs a notebook, with two changes.

Faster import: nbformat imports jsonschema, which builds grammars of web addresses if it finds packages for them, as
installed with JupyterLab. This takes up to seconds, and the format of notebooks has no such addresses. These packages
are hidden during the import.

Bug fix: a cell that writes into an `Output` widget, as `interact` does, could wait for its timeout although it had
ended (nbclient's issue 312).
"""

import sys

if hidden := {"rfc3987_syntax", "rfc3986_validator"} - sys.modules.keys():
    sys.modules.update(dict.fromkeys(hidden))
import nbclient.client
import nbformat
import zmq
from nbclient.output_widget import OutputWidget as _OutputWidget
from nbformat import NotebookNode

for name in hidden:  # later imports by name find them
    del sys.modules[name]

__all__ = ["NotebookNode", "OutputWidget", "nbclient", "nbformat"]


class OutputWidget(_OutputWidget):
    """The counterpart of the kernel's `Output` widget when a notebook runs headless."""

    def send(self, *given, **named) -> None:
        """Send to the kernel, then wake the task that waits for a reply: sending may consume the reply's signal."""
        super().send(*given, **named)
        self.kernel_client.shell_channel.socket.get(zmq.EVENTS)


nbclient.client.OutputWidget = OutputWidget
