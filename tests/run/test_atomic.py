"""Files are whole or absent; what is no regular file is refused, not waited for."""

import os
import stat

import pytest
from support import visible

from vsp.run import atomic
from vsp.run.atomic import DamagedFile, MissingFile, read_bytes, sha256, write_text
from vsp.run.listed import list_file, read_listed, write_listed
from vsp.run.sealed import read_sealed

READERS = (read_bytes, sha256, read_sealed, read_listed)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failed_write_keeps_the_old_file_and_leaves_nothing(tmp_path, monkeypatch, error):
    def fail(handle):
        temporary, old = visible(tmp_path)
        assert temporary.startswith(".") and temporary.endswith(".txt") and (tmp_path / old).read_text() == "old"
        raise error

    write_text(tmp_path / "x.txt", "old")
    monkeypatch.setattr(os, "fsync", fail)
    for name in ("x.txt", "new.txt"):
        with pytest.raises(error):
            write_text(tmp_path / name, "half")
    assert visible(tmp_path) == ["x.txt"] and (tmp_path / "x.txt").read_text() == "old"


def test_text_is_utf8_with_unix_line_ends_and_has_a_known_sum(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    with open(tmp_path / "x.txt") as reader:
        write_text(tmp_path / "x.txt", "é\nb\n")
        assert reader.read() == "old"  # whole, whoever writes meanwhile
    assert (tmp_path / "x.txt").read_bytes() == "é\nb\n".encode()
    write_text(tmp_path / "x", "abc")
    assert sha256(tmp_path / "x") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


@pytest.mark.parametrize("put", [os.mkdir, os.mkfifo, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_regular_file_is_refused_and_not_waited_for(tmp_path, put):
    """By readers, and as a manifest."""
    for name in ("x", "MANIFEST.sha256"):
        put(tmp_path / name)
    for read in READERS:
        with pytest.raises(DamagedFile, match="x: is a folder, a FIFO or a device, expected a file: move it away"):
            read(tmp_path / "x")
    (tmp_path / "y").write_text("y")
    for listing in (read_listed, list_file, lambda path: write_listed(path, "z")):
        with pytest.raises(DamagedFile, match="MANIFEST.sha256: is a folder, a FIFO or a device"):
            listing(tmp_path / "y")


def test_a_missing_file_and_links(tmp_path):
    path = tmp_path / "a file"
    for target in (None, "nothing", path):
        if target:
            path.unlink(missing_ok=True)
            path.symlink_to(target)
        for read in READERS:
            with pytest.raises(MissingFile) as missing:
                read(path)
            assert str(missing.value) == f"{path}: no such file"  # a user's own: git knows nothing of it
    with pytest.raises(MissingFile, match="none: no such file: `git checkout .*none` restores a committed file"):
        read_bytes(atomic.ROOT / "vsp" / "none")
    (tmp_path / "x").write_bytes(b"content")
    (tmp_path / "link").symlink_to("x")
    assert read_bytes(tmp_path / "link") == b"content"


def test_a_new_file_follows_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "x.txt", "new")
        write_text(tmp_path / "x.txt", "again")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "x.txt").stat().st_mode) == 0o640
