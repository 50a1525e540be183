"""`make lab`: open JupyterLab on the notebooks, without nbgrader's buttons, with three lines of output."""

from __future__ import annotations

import os
import secrets
import socket
import sys

from .atomic import ROOT

FIRST = ROOT / "notebooks" / "01_teacher.ipynb"


def main() -> None:
    """Open the first notebook. Further arguments are passed to `jupyter lab`."""
    os.environ["JUPYTER_CONFIG_PATH"] = str(ROOT / ".jupyter")  # read when jupyterlab is imported
    from jupyterlab.labapp import LabApp

    port, token = _free_port(), secrets.token_hex(16)
    print(f"JupyterLab opens in your browser, or here: http://localhost:{port}/lab/tree/{FIRST.name}?token={token}")
    print("Press Control-C twice to stop it.", flush=True)
    options = [f"--port={port}", "--port-retries=0", f"--IdentityProvider.token={token}", "--log-level=ERROR"]
    root = ["--allow-root"] * (hasattr(os, "geteuid") and os.geteuid() == 0)
    LabApp.launch_instance([str(FIRST), *options, *root, *sys.argv[1:]])


def _free_port(wanted: int = 8888) -> int:
    """Return the port `wanted`, or another free one if a program uses it."""
    for port in (wanted, 0):
        with socket.socket() as trial:
            try:
                trial.bind(("127.0.0.1", port))
                return trial.getsockname()[1]
            except OSError:
                continue
    raise OSError("no port is free on this machine: close a program that uses one")


if __name__ == "__main__":
    main()
