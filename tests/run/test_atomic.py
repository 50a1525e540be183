"""Files are whole or absent; what is no regular file is refused, not waited for."""

import errno
import os
import socket
import stat
import subprocess
import sys

import pytest

from vsp.run import atomic
from vsp.run.atomic import DamagedFile, MissingFile, atomic_path, open_regular, read_bytes, sha256, write_text
from vsp.run.listed import list_file, read_listed, read_table, write_listed
from vsp.run.locks import file_lock, terminate_peers
from vsp.run.sealed import read_sealed


def visible(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_failed_write_keeps_the_old_file_and_leaves_nothing(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    with pytest.raises(RuntimeError), atomic_path(tmp_path / "x.txt") as temporary:
        temporary.write_text("half")
        raise RuntimeError
    with pytest.raises(KeyboardInterrupt), atomic_path(tmp_path / "new.txt") as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert visible(tmp_path) == ["x.txt"] and (tmp_path / "x.txt").read_text() == "old"


def test_nothing_is_there_under_the_name_until_the_block_ends(tmp_path):
    with atomic_path(tmp_path / "x.pdf") as temporary:
        temporary.write_text("content")
        assert not (tmp_path / "x.pdf").exists() and temporary.suffix == ".pdf" and temporary.parent == tmp_path
        assert temporary.match(atomic.TEMPORARY) and list(tmp_path.rglob(atomic.TEMPORARY)) == [temporary]
    assert (tmp_path / "x.pdf").read_text() == "content" and not (tmp_path / "x.pdf").match(atomic.TEMPORARY)


@pytest.mark.parametrize("umask", [0o022, 0o002, 0o077])
def test_a_new_file_follows_the_umask(tmp_path, umask):
    before = os.umask(umask)
    try:
        write_text(tmp_path / "x.txt", "new")
        write_text(tmp_path / "x.txt", "again")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "x.txt").stat().st_mode) == 0o666 & ~umask


def test_a_reader_in_the_middle_of_a_file_keeps_the_old_one(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    with open(tmp_path / "x.txt", encoding="utf-8") as reader:
        write_text(tmp_path / "x.txt", "new")
        assert reader.read() == "old" and (tmp_path / "x.txt").read_text() == "new"


def test_a_killed_writer_leaves_the_old_file(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    code = (
        "import os, sys; from vsp.run.atomic import atomic_path\n"
        "with atomic_path(sys.argv[1]) as t: t.write_text('half'); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "x.txt"], cwd=atomic.ROOT)
    assert done.returncode == -9 and (tmp_path / "x.txt").read_text() == "old"
    atomic.remove_leftovers(tmp_path / "x.txt")
    assert visible(tmp_path) == ["x.txt"]


def test_text_is_utf8_with_unix_line_ends_and_has_a_known_sum(tmp_path):
    write_text(tmp_path / "x.txt", "é\nb\n")
    assert (tmp_path / "x.txt").read_bytes() == "é\nb\n".encode()
    write_text(tmp_path / "x", "abc")
    assert sha256(tmp_path / "x") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


# In place of a file


def put_folder(path):
    path.mkdir()


def put_link_to_device(path):
    path.symlink_to("/dev/zero")


def put_socket(path):
    os.chdir(path.parent)  # the names of sockets are short
    socket.socket(socket.AF_UNIX).bind(path.name)


READERS = (read_bytes, sha256, read_sealed, read_listed, read_table)


@pytest.mark.parametrize("put", [put_folder, os.mkfifo, put_link_to_device, put_socket])
def test_what_is_no_regular_file_is_refused_and_not_waited_for(tmp_path, monkeypatch, put):
    """By readers, as a manifest, as a lock."""
    monkeypatch.chdir(tmp_path)
    for name in ("x", "MANIFEST.sha256", "lock"):
        put(tmp_path / name)
    for read in READERS:
        with pytest.raises(DamagedFile, match="x: is a folder, a FIFO or a device, expected a file: move it away"):
            read(tmp_path / "x")
    (tmp_path / "y").write_text("y")
    for listing in (read_listed, list_file, lambda path: write_listed(path, "z")):
        with pytest.raises(DamagedFile, match="MANIFEST.sha256: is a folder, a FIFO or a device"):
            listing(tmp_path / "y")
    with pytest.raises(DamagedFile, match="lock: is a folder"), file_lock(tmp_path / "lock", "writes here"):
        pass
    terminate_peers(tmp_path)
    assert (tmp_path / "y").read_text() == "y"


def test_a_missing_file_and_a_link_to_nothing(tmp_path):
    path = tmp_path / "a file"
    for read in (read_bytes, read_sealed, read_listed, read_table):
        with pytest.raises(MissingFile) as found:
            read(path)
        assert str(found.value) == f"{path}: no such file"  # a user's own: git knows nothing of it
    with pytest.raises(MissingFile, match="none: no such file: `git checkout .*none` restores a committed file"):
        read_bytes(atomic.ROOT / "vsp" / "none")
    path.symlink_to(tmp_path / "nothing")
    with pytest.raises(MissingFile, match="a file: no such file, but a link to .*nothing"):
        read_bytes(path)
    path.unlink()
    path.symlink_to(path)
    with pytest.raises(OSError, match="a file"):
        read_bytes(path)


def test_a_link_to_a_file_is_read(tmp_path):
    (tmp_path / "x").write_bytes(b"content")
    (tmp_path / "link").symlink_to("x")
    assert read_bytes(tmp_path / "link") == b"content"
    with open_regular(tmp_path / "new", "ab") as file:
        file.write(b"1")
    assert read_bytes(tmp_path / "new") == b"1"


# Full and closed disks


def test_a_full_disk_is_told_with_the_file_and_a_hint(tmp_path):
    path = tmp_path / "figure.pdf"
    path.write_bytes(b"before")
    with pytest.raises(OSError) as error, atomic_path(path) as temporary:
        temporary.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert atomic.one_line(error.value).startswith(f"{path}: No space left on device: free some space, ")
    assert path.read_bytes() == b"before" and visible(tmp_path) == ["figure.pdf"]


def test_something_else_in_the_place_of_an_output_is_told(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    for path in (tmp_path / "folder", tmp_path / "file" / "x"):
        with pytest.raises(OSError) as error:
            write_text(path, "new")
        said = atomic.one_line(error.value)
        assert said.endswith(": something else has this name: move it away") and "\n" not in said


def test_an_error_without_a_hint_is_raised_again():
    bug = FileNotFoundError(errno.ENOENT, "No such file", "x")
    with pytest.raises(FileNotFoundError) as error:
        atomic.one_line(bug)
    assert error.value is bug and atomic.disk_hint(None) is None
