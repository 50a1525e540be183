"""The hand-out: one zip file with the lessons for students and everything they need.

The lessons need no torch, because teachers act by NumPy, so a student's set-up is a small download.
"""

from __future__ import annotations

import io
import re
import tomllib
import zipfile
from pathlib import Path

from vsp.run.atomic import ROOT, write_bytes

FOLDER = "vsp-course"
UNUSED = ("papermill",)  # dependencies of the package that the course does not need
CODE = ("vsp/**/*.py", "vsp/show/**/*.js", "vsp/show/**/*.css", "vsp_beyond/**/*.py")
CHECKS = tuple(f"vsp_course/{name}.py" for name in ("__init__", "drawing", "feedback", "lesson_*"))
FILES = ("LICENSE", "docs/article.html", "data/paper/*", "data/teachers/*.*", *CODE, *CHECKS)


def write_handout(path: Path, copies: dict[str, str]) -> None:
    """Write a zip file with the students' notebooks `copies` (file name: text), the package, its data and the list of
    packages to install. Same sources, same bytes."""
    readme, project = (Path(__file__).with_name(name).read_text("utf-8") for name in ("handout.md", "project.md"))
    texts = {**copies, "README.md": readme, "requirements.txt": requirements(), "project.md": project}
    files = {file.relative_to(ROOT).as_posix(): file for pattern in FILES for file in ROOT.glob(pattern)}
    contents = {name: text.encode() for name, text in texts.items()}
    contents |= {name: file.read_bytes() for name, file in files.items()}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in sorted(contents):
            member = zipfile.ZipInfo(f"{FOLDER}/{name}")  # dated 1980, as all of them
            member.external_attr = 0o644 << 16
            archive.writestr(member, contents[name], zipfile.ZIP_DEFLATED)
    write_bytes(path, content.getvalue())


def requirements() -> str:
    """Return the lines of requirements.txt: the packages that the lessons need, in the versions of environment.lock."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = re.findall(r"^[\w-]+", "\n".join(project["dependencies"]), re.MULTILINE)
    lock = (ROOT / "environment.lock").read_text(encoding="utf-8")
    locked = dict(re.findall(r"^([\w-]+)==(\S+)", lock, re.MULTILINE))
    return "".join(f"{name}=={locked[name]}\n" for name in wanted if name not in UNUSED)
