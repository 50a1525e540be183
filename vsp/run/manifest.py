"""Update manifests after files were changed on purpose: `python -m vsp.run.manifest [FOLDER ...]`."""

import argparse
from pathlib import Path

from .atomic import ROOT
from .command import in_one_line
from .listed import MANIFEST, list_folder

FOLDERS = sorted(manifest.parent for manifest in (ROOT / "data").rglob(MANIFEST))


def main() -> None:
    """Write new manifests of the folders, with all their files as they are."""
    parser = argparse.ArgumentParser(prog="python -m vsp.run.manifest", description=main.__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="folders with manifests (default: those of data/)")
    for folder in parser.parse_args().folders or FOLDERS:
        if not folder.is_dir():
            parser.error(f"{folder}: no such folder")
        print(f"{folder / MANIFEST}: {list_folder(folder)} files")


if __name__ == "__main__":
    with in_one_line():
        main()
