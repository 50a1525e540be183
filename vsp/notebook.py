"""nbformat and nbclient, with one thing left out and one mended, for every command that reads or runs a notebook.

Left out: jsonschema, which nbformat asks, builds a whole grammar of international addresses if it finds
`rfc3987_syntax`, which JupyterLab brings; that takes seconds, and no notebook's format has such an address.

Mended: a cell that writes into an `Output` widget, as `interact` does, could wait for its timeout although it had ended
(nbclient's issue 312).
"""

import sys

if hidden := "rfc3987_syntax" not in sys.modules:
    sys.modules["rfc3987_syntax"] = None
import nbclient.client  # noqa: E402
import nbformat  # noqa: E402
import zmq  # noqa: E402
from nbclient.output_widget import OutputWidget as _OutputWidget  # noqa: E402
from nbformat import NotebookNode  # noqa: E402

if hidden:  # who asks for it by name shall find it
    del sys.modules["rfc3987_syntax"]

__all__ = ["NotebookNode", "OutputWidget", "nbformat"]


class OutputWidget(_OutputWidget):
    """What stands in for the widget where a notebook runs headless."""

    def send(self, *given, **named) -> None:
        """Send to the kernel, then wake who waits for its reply: sending may swallow the sign that it has come."""
        super().send(*given, **named)
        self.kernel_client.shell_channel.socket.get(zmq.EVENTS)


nbclient.client.OutputWidget = OutputWidget
