"""`make manifest`: accept the files of data/ as they are, for somebody who changed one on purpose.

    python -m vsp.manifest data/paper

Each folder has a `MANIFEST.sha256` with the checksums of its files, see `vsp.store`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .store import MANIFEST, ROOT, list_folder

FOLDERS = tuple(ROOT / "data" / name for name in ("paper", "teachers", "teachers/short", "results"))


def main() -> None:
    """Write the manifests of the folders anew: all that lies there, as it is."""
    parser = argparse.ArgumentParser(prog="python -m vsp.manifest", description=main.__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="if none is given, those of data/")
    for folder in parser.parse_args().folders or FOLDERS:
        if not folder.is_dir():
            parser.error(f"{folder}: no such folder")
        list_folder(folder)
        print(f"{folder / MANIFEST}: {len((folder / MANIFEST).read_bytes().splitlines())} files")


if __name__ == "__main__":
    main()
