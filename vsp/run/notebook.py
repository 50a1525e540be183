"""nbformat and nbclient for every command that reads or runs a notebook, with one part left out and one repaired.

Left out: nbformat imports jsonschema, which builds whole grammars of addresses where it finds packages for them, which
JupyterLab brings. That takes up to seconds, and the format of notebooks has no such address.

Repaired: a cell that writes into an `Output` widget, as `interact` does, could wait for its timeout although it had
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

for name in hidden:  # whoever imports them by name finds them
    del sys.modules[name]

__all__ = ["NotebookNode", "OutputWidget", "nbclient", "nbformat"]


class OutputWidget(_OutputWidget):
    """The kernel's counterpart of an `Output` widget where a notebook runs headless."""

    def send(self, *given, **named) -> None:
        """Send to the kernel, then wake whoever waits for its reply: sending may swallow the sign that it arrived."""
        super().send(*given, **named)
        self.kernel_client.shell_channel.socket.get(zmq.EVENTS)


nbclient.client.OutputWidget = OutputWidget
