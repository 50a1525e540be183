import errno
import json
import os
import signal
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

from vsp import store
from vsp.store import DamagedFile, atomic_path, load, read_carded, save, sha256, write_carded, write_json, write_text

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2], dtype=np.int32), "none": np.zeros((0, 2))}
ABOUT = {"kind": "Thing", "task": "x", "n": 3, "nested": {"list": [1.5, None, True]}}


def visible(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_sealed_file_comes_back_exactly(tmp_path):
    save(tmp_path / "deep" / "er" / "x.run", ARRAYS, ABOUT)
    arrays, about = load(tmp_path / "deep" / "er" / "x.run", kind="Thing")
    assert about == ABOUT and arrays.keys() == ARRAYS.keys()
    assert all(arrays[k].dtype == v.dtype and np.array_equal(arrays[k], v) for k, v in ARRAYS.items())


def test_arrays_in_any_memory_order_come_back(tmp_path):
    a = np.arange(12.0).reshape(3, 4)
    save(tmp_path / "x", {"t": a.T, "s": a[:, ::2]}, ABOUT)
    arrays, _ = load(tmp_path / "x", kind="Thing")
    assert np.array_equal(arrays["t"], a.T) and np.array_equal(arrays["s"], a[:, ::2])


def test_the_same_content_gives_the_same_bytes(tmp_path):
    save(tmp_path / "x", ARRAYS, ABOUT)
    save(tmp_path / "y", ARRAYS, dict(reversed(ABOUT.items())))
    assert (tmp_path / "x").read_bytes() == (tmp_path / "y").read_bytes()


def test_one_flipped_bit_anywhere_is_found(tmp_path):
    path = tmp_path / "x"
    save(path, ARRAYS, ABOUT)
    content = path.read_bytes()
    for position in range(len(content)):
        damaged = bytearray(content)
        damaged[position] ^= 1 << position % 8
        path.write_bytes(damaged)
        with pytest.raises(DamagedFile, match="SHA-256 is [0-9a-f]{64}, expected"):
            load(path, kind="Thing")


def test_a_truncated_or_longer_file_is_found(tmp_path):
    path = tmp_path / "x"
    save(path, ARRAYS, ABOUT)
    content = path.read_bytes()
    for damaged in [content[:n] for n in (0, 1, 63, 64, 65, 66, 200, len(content) - 1)] + [content + b"\0"]:
        path.write_bytes(damaged)
        with pytest.raises(DamagedFile):
            load(path, kind="Thing")


def test_another_kind_and_a_missing_file(tmp_path):
    save(tmp_path / "x", ARRAYS, ABOUT)
    with pytest.raises(DamagedFile, match="holds a 'Thing', expected a 'Run'"):
        load(tmp_path / "x", kind="Run")
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "y", kind="Run")


@pytest.mark.parametrize("content", [b"hello", b"{}", os.urandom(5000), b"PK\x03\x04" + bytes(100)])
def test_a_file_of_another_origin_is_refused(tmp_path, content):
    (tmp_path / "x").write_bytes(content)
    with pytest.raises(DamagedFile):
        load(tmp_path / "x", kind="Thing")


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
    assert (tmp_path / "x.pdf").read_text() == "content"
    assert stat.S_IMODE((tmp_path / "x.pdf").stat().st_mode) == 0o644


def test_a_reader_in_the_middle_of_a_file_keeps_the_old_one(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    with open(tmp_path / "x.txt", encoding="utf-8") as reader:
        write_text(tmp_path / "x.txt", "new")
        assert reader.read() == "old" and (tmp_path / "x.txt").read_text() == "new"


def test_a_killed_writer_leaves_the_old_file(tmp_path):
    write_text(tmp_path / "x.txt", "old")
    code = (
        "import os, sys; from vsp.store import atomic_path\n"
        "with atomic_path(sys.argv[1]) as t: t.write_text('half'); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "x.txt"], cwd=store.ROOT)
    assert done.returncode == -9 and (tmp_path / "x.txt").read_text() == "old"


def test_text_and_json(tmp_path):
    write_text(tmp_path / "x.txt", "é\nb\n")
    assert (tmp_path / "x.txt").read_bytes() == "é\nb\n".encode()
    write_json(tmp_path / "x.json", {"a": [1, 2.5]})
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": [1, 2.5]}
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError):
            write_json(tmp_path / "x.json", {"a": value})
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": [1, 2.5]}


def test_sha256_of_a_known_text(tmp_path):
    write_text(tmp_path / "x", "abc")
    assert sha256(tmp_path / "x") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_content_with_a_card(tmp_path):
    path = tmp_path / "x.safetensors"
    write_carded(path, b"weights", {"task": "t"})
    content, card = read_carded(path)
    assert content == b"weights" and card == {"task": "t", "sha256": sha256(path)}


def test_a_card_that_does_not_fit_its_file(tmp_path):
    path = tmp_path / "x.safetensors"
    write_carded(path, b"weights", {"task": "t"})
    path.write_bytes(b"weighus")
    with pytest.raises(DamagedFile, match="SHA-256 is [0-9a-f]{64}, its card says [0-9a-f]{64}"):
        read_carded(path)


@pytest.mark.parametrize("card", ["", "{", "[]", "3", '{"task": "t"}', "\x00\x01"])
def test_a_card_that_is_none(tmp_path, card):
    (tmp_path / "x.safetensors").write_bytes(b"weights")
    (tmp_path / "x.json").write_text(card)
    with pytest.raises(DamagedFile, match="not a card"):
        read_carded(tmp_path / "x.safetensors")


def test_a_missing_part_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="x.safetensors: no such file"):
        read_carded(tmp_path / "x.safetensors")
    (tmp_path / "x.safetensors").write_bytes(b"weights")
    with pytest.raises(FileNotFoundError, match="x.json: no such file"):
        read_carded(tmp_path / "x.safetensors")


# Full and closed disks, and two processes at once


def test_a_full_disk_is_told_of_with_the_file_and_the_fix(tmp_path):
    path = tmp_path / "figure.pdf"
    path.write_bytes(b"before")
    with pytest.raises(OSError) as error, store.atomic_path(path) as temporary:
        temporary.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")
    said = store.reason(error.value)
    assert said == f"{path}: No space left on device: free some space, or name another folder: `make OUT=folder`"
    assert path.read_bytes() == b"before" and list(tmp_path.iterdir()) == [path]


def test_an_error_without_a_fix_is_raised_again():
    bug = FileNotFoundError(errno.ENOENT, "No such file", "x")
    with pytest.raises(FileNotFoundError) as error:
        store.reason(bug)
    assert error.value is bug and store.fix(None) is None


def test_what_a_kill_leaves_has_a_name_that_is_known(tmp_path):
    with store.atomic_path(tmp_path / "0001.run") as temporary:
        assert temporary.match(store.TEMPORARY) and list(tmp_path.rglob(store.TEMPORARY)) == [temporary]
    assert not (tmp_path / "0001.run").match(store.TEMPORARY)


def test_one_after_the_other(tmp_path, capfd):
    """The second waits, says so, and comes in when the first is killed."""
    lock = tmp_path / "build" / "lock"
    hold = f"from vsp.store import alone\nwith alone({str(lock)!r}, 'x'):\n  print(1, flush=True)\n  input()"
    first = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    first.stdout.readline()
    threading.Timer(0.3, first.kill).start()
    with store.alone(lock, "writes here"):
        assert first.wait() == -signal.SIGKILL
    assert capfd.readouterr().err == "another run writes here: waiting for it to end\n"
    with store.alone(lock, "writes here"):
        assert capfd.readouterr().err == ""
