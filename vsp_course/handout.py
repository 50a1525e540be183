"""The hand-out: one zip file with the lessons for students and everything they need.

The code comes as a wheel. The lessons need no torch, because teachers act by NumPy, so a set-up is a small download.
"""

import base64
import hashlib
import io
import re
import zipfile
from pathlib import Path

from vsp.run.atomic import ROOT, write_bytes

from .feedback import tables

PARTS = tables("handout.toml")


def write_handout(path: Path, copies: dict[str, str]) -> None:
    """Write a zip file with the texts `copies` (file name: text), a wheel, and the lists of packages to install. Same
    sources, same bytes."""
    wheel = f"{PARTS['wheel']}-py3-none-any.whl"
    texts = copies | {name: Path(__file__).with_name(name).read_text("utf-8") for name in PARTS["beside"]}
    texts |= {"README.md": texts.pop("handout.md"), "hosted.txt": pinned(PARTS["hosted"])}
    texts["requirements.txt"] = f"{pinned(PARTS['hosted'] + PARTS['own'])}./{wheel}\n"
    contents = {name: text.encode() for name, text in texts.items()} | _files(PARTS["files"]) | {wheel: _wheel()}
    write_bytes(path, _zipped({f"{PARTS['folder']}/{name}": content for name, content in contents.items()}))


def _files(patterns: list[str]) -> dict[str, bytes]:
    files = [file for pattern in patterns for file in ROOT.glob(pattern)]
    return {file.relative_to(ROOT).as_posix(): file.read_bytes() for file in files}


def _zipped(contents: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name in sorted(contents):
            member = zipfile.ZipInfo(name)  # dated 1980, as all of them
            member.external_attr = 0o644 << 16
            archive.writestr(member, contents[name], zipfile.ZIP_DEFLATED)
    return made.getvalue()


def _wheel() -> bytes:
    """Return code, teachers and the paper's values as a wheel (PyPA's binary distribution format 1.0)."""
    contents = _files(PARTS["code"]) | {f"vsp/{name}": content for name, content in _files(PARTS["data"]).items()}
    name, version = (whole := PARTS["wheel"]).split("-")
    about = {"METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"}
    about["WHEEL"] = "Wheel-Version: 1.0\nGenerator: vsp_course\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    contents |= {f"{whole}.dist-info/{part}": text.encode() for part, text in about.items()}
    sums = {file: base64.urlsafe_b64encode(hashlib.sha256(each).digest()).decode() for file, each in contents.items()}
    record = [f"{file},sha256={sums[file].rstrip('=')},{len(content)}" for file, content in contents.items()]
    listed = "\n".join([*record, f"{whole}.dist-info/RECORD,,\n"]).encode()
    return _zipped(contents | {f"{whole}.dist-info/RECORD": listed})


def pinned(names: list[str]) -> str:
    """Return a line for each package, with its version in environment.lock."""
    lock = (ROOT / "environment.lock").read_text(encoding="utf-8")
    locked = dict(re.findall(r"^([\w-]+)==(\S+)", lock, re.MULTILINE))
    return "".join(f"{name}=={locked[name]}\n" for name in names)
