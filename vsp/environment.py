"""Is .venv as `make venv` left it? Of the standard library alone: nothing that this looks at need work.

    .venv/bin/python -X utf8 -I vsp/environment.py           says what is not, and then ends with status 1
    .venv/bin/python -X utf8 -I vsp/environment.py --built   notes what there is now, if pyproject.toml asks for no more

The note, .venv/built-from, is written last: an unfinished environment is never taken for a whole one.
"""

import csv
import hashlib
import json
import os
import re
import sys
import tomllib
from importlib.metadata import Distribution, distributions
from pathlib import Path

LOCK, BUILT, PROJECT = Path("environment.lock"), Path(".venv/built-from"), Path("pyproject.toml")


def described() -> dict:
    """The lock, the folder, and the version of every package that is installed."""
    packages = {_plain(package.name): package.version for package in distributions()}
    return {"lock": hashlib.sha256(LOCK.read_bytes()).hexdigest(), "folder": os.getcwd(), "packages": packages}


def changes() -> list[str]:
    """What differs from the note, in words; packages that came later are nobody's concern."""
    try:
        built, now = json.loads(BUILT.read_text(encoding="utf-8")), described()
    except (OSError, ValueError):
        return ["its set-up did not end"]
    found = [f"{LOCK} has changed"] if built["lock"] != now["lock"] else []
    found += [f"it was set up in {built['folder']}"] if built["folder"] != now["folder"] else []
    for name, version in built["packages"].items():
        if (there := now["packages"].get(name)) != version:
            found.append(f"{name} is {there}, not {version}" if there else f"{name} is missing")
    return found + [f"{file} is damaged" for package in distributions() for file in _damaged(package)]


def lacking() -> list[str]:
    """The packages that pyproject.toml asks for and that are not installed."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    asked = project["dependencies"] + project["optional-dependencies"]["test"]
    there = described()["packages"]
    return [one for one in asked if _plain(re.match(r"[\w.-]+", one)[0]) not in there]


def _damaged(package: Distribution) -> list[str]:
    """Its files that are gone or have another size; a look at each content would take seconds."""
    folder = package.locate_file("")
    rows = csv.reader((package.read_text("RECORD") or "").splitlines())
    return [name for name, _, size in rows if size and _size(f"{folder}/{name}") != int(size)]


def _size(path: str) -> int | None:
    try:
        return os.stat(path).st_size
    except OSError:
        return None


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def main() -> str | None:
    """The command line; returns what is not as it should be, for `sys.exit`, or None."""
    if "--built" not in sys.argv:
        found = changes()
        return "; ".join(found[:3] + ["..."] * (len(found) > 3)) or None
    if missing := lacking():
        return f"error: {LOCK} lacks {', '.join(missing)}, which {PROJECT} asks for: `git checkout {LOCK}`"
    BUILT.write_text(json.dumps(described(), indent=2), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
