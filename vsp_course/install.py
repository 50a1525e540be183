"""Install the course for a Jupyter that somebody else runs: Colab, Kaggle, a university's JupyterHub.

A lesson's first cell runs it. Packages go into a folder beside the lessons, so nothing of the host changes, and nobody
needs to be root. What the kernel has loaded before stays; then it must be restarted.
"""

import subprocess
import sys
from pathlib import Path

HERE = Path.cwd()
FOLDER = HERE / "packages-{}.{}".format(*sys.version_info)  # compiled parts fit one version of Python
LARGE = ("numpy", "scipy", "pandas", "matplotlib", "sklearn", "gymnasium")  # two versions of these do not mix


def begin() -> None:
    """Install what is missing, and let this kernel find it first."""
    pip = "-m pip install --quiet --disable-pip-version-check --no-deps --no-compile --upgrade -r hosted.txt --target"
    new = not (done := FOLDER / "installed").exists()
    if new:
        print("Installing the packages of the course, 0.1 GB to load and 0.4 GB on the disk ...", flush=True)
        if subprocess.run([sys.executable, *pip.split(), FOLDER, *HERE.glob("*.whl")]).returncode:
            raise SystemExit("Nothing is installed: what pip says above is why. Then run this cell again.")
        done.touch()
    sys.path.insert(0, str(FOLDER))
    other = [name for name in LARGE if str(FOLDER) not in str(getattr(sys.modules.get(name), "__file__", FOLDER))]
    if other and new:
        print("RESTART the kernel now (Kernel or Runtime menu), then run this cell again: it had loaded", *other)
    elif other:
        print("Ready, but the host loads its own", *other, "by itself: numbers may differ in their last digits.")
    else:
        print("Ready. Whatever the course installs stays in", HERE)


begin()
