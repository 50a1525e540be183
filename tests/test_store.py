import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vsp import store
from vsp.store import MANIFEST, DamagedFile, atomic_path, load, read_carded, save, sha256, write_carded, write_text

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


def test_text(tmp_path):
    write_text(tmp_path / "x.txt", "é\nb\n")
    assert (tmp_path / "x.txt").read_bytes() == "é\nb\n".encode()


def test_sha256_of_a_known_text(tmp_path):
    write_text(tmp_path / "x", "abc")
    assert sha256(tmp_path / "x") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_content_with_a_card(tmp_path):
    path = tmp_path / "x.safetensors"
    write_carded(path, b"weights", {"task": "t"})
    content, card = read_carded(path)
    assert content == b"weights" and card == {"task": "t", "sha256": sha256(path)}


def test_a_card_with_nan_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(ValueError):
        write_carded(tmp_path / "x.safetensors", b"weights", {"score": np.nan})
    assert visible(tmp_path) == []


def test_a_card_that_does_not_fit_its_file(tmp_path):
    path = tmp_path / "x.safetensors"
    write_carded(path, b"weights", {"task": "t"})
    path.write_bytes(b"weighus")
    with pytest.raises(DamagedFile, match="x.safetensors: SHA-256 is [0-9a-f]{64}, MANIFEST.sha256 beside it has"):
        read_carded(path)
    (tmp_path / MANIFEST).unlink()  # somebody's own folder
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


# Listed files


def flipped(content, bit):
    damaged = bytearray(content)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


@pytest.fixture
def table(tmp_path):
    """A listed table, and another one beside it."""
    for name in ("a.csv", "b.csv"):
        store.write_listed(tmp_path / name, f"x,y\n1,{name}\n")
    return tmp_path / "b.csv"


def test_a_listed_table_comes_back(table):
    assert store.read_table(table).to_dict("list") == {"x": [1], "y": ["b.csv"]}
    assert store.read_table(table, dtype=str)["x"][0] == "1" and table.read_bytes() == b"x,y\n1,b.csv\n"
    lines = [f"{sha256(table.with_name(name))}  {name}\n" for name in ("a.csv", "b.csv")]
    assert (table.parent / MANIFEST).read_text() == "".join(lines)
    store.write_listed(table, b"x\n2\n")
    assert store.read_table(table)["x"].tolist() == [2] and visible(table.parent) == [MANIFEST, "a.csv", "b.csv"]


def test_one_flipped_bit_in_a_listed_file_or_its_line_is_found_before_it_is_parsed(table, monkeypatch):
    monkeypatch.setattr("pandas.read_csv", lambda *given: pytest.fail("parsed"))
    manifest = table.parent / MANIFEST
    line = manifest.read_bytes().index(b"\n") + 1  # of b.csv: the second one
    for path, first in ((table, 0), (manifest, line)):
        content = path.read_bytes()
        for bit in range(8 * first, 8 * len(content)):
            path.write_bytes(flipped(content, bit))
            with pytest.raises(DamagedFile):
                store.read_table(table)
        path.write_bytes(content)


def test_a_truncated_listed_file_or_manifest_is_found(table):
    for path in (table, table.parent / MANIFEST):
        content = path.read_bytes()
        for size in range(len(content)):
            path.write_bytes(content[:size])
            with pytest.raises(DamagedFile):
                store.read_listed(table)
        path.write_bytes(content)
    assert store.read_listed(table)


def test_the_words_for_an_altered_file_name_the_ways_out(table, tmp_path):
    expected = sha256(table)
    table.write_text("x\n3\n")
    with pytest.raises(DamagedFile) as found:
        store.read_listed(table)
    assert str(found.value) == (
        f"{table}: SHA-256 is {sha256(table)}, MANIFEST.sha256 beside it has "
        f"{expected}: "
        f"`git checkout {table}` brings back a committed one; if it is as it should be, `make manifest` "
        f"(or `python -m vsp.manifest {table.parent}`) lists it so"
    )
    (tmp_path / "c.csv").write_text("x\n")
    with pytest.raises(DamagedFile, match="c.csv: .*MANIFEST.sha256 beside it has no such file"):
        store.read_listed(tmp_path / "c.csv")
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(DamagedFile, match="has no such file"):
        store.read_listed(table)


@pytest.mark.parametrize(
    ("path", "target"),
    [
        ("data/teachers/short/x.json", "short-teachers"), ("data/teachers/x.json", "teachers"),
        ("data/results/teachers.csv", "study"), ("data/results/scale.csv", "bench"),
        ("data/results/kills.csv", "torture"),
        ("data/results/trust.csv", "bench torture"), ("data/results/SimpleGoal-v0.csv", "paper-figures"),
        ("data/results/beyond_LunarLanderContinuous-v3.csv", "beyond-long"), ("data/results/beyond_race.csv", "beyond"),
    ],
)  # fmt: skip
def test_the_words_name_the_target_that_makes_a_file(tmp_path, path, target):
    with pytest.raises(FileNotFoundError, match=f"no such file; `make {target}` makes it anew, `git checkout"):
        store.read_listed(tmp_path / path)


def test_somebody_accepts_a_file_as_it_is(table, tmp_path):
    table.write_text("x\n3\n")
    (tmp_path / "c.csv").write_text("x\n4\n")
    (tmp_path / "a.csv").unlink()
    (tmp_path / ".DS_Store").write_text("")
    (tmp_path / MANIFEST).write_text("rubbish")
    store.list_folder(tmp_path)
    assert [store.read_table(tmp_path / name)["x"][0] for name in ("b.csv", "c.csv")] == [3, 4]
    assert [line[66:] for line in (tmp_path / MANIFEST).read_text().splitlines()] == ["b.csv", "c.csv"]


def test_a_writer_killed_between_file_and_line_is_healed_by_the_next(table, monkeypatch):
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(store, "_write_manifest", lambda *given: (_ for _ in ()).throw(KeyboardInterrupt))
        store.write_listed(table, "x\n5\n")
    with pytest.raises(DamagedFile):
        store.read_table(table)
    store.write_listed(table, "x\n5\n")
    assert store.read_table(table)["x"][0] == 5 and store.read_listed(table.with_name("a.csv"))


def test_what_is_listed_already_is_not_written_again(table):
    before = (table.parent / MANIFEST).stat()
    store.list_file(table)
    store.write_listed(table, table.read_bytes())
    assert (table.parent / MANIFEST).stat().st_ino == before.st_ino


def test_of_several_writers_none_loses_a_line(tmp_path):
    def write(name):
        for i in range(20):
            store.write_listed(tmp_path / f"{name}-{i}.csv", f"{i}")

    with ThreadPoolExecutor() as pool:  # the lock is between open files, so threads are as good as processes
        list(pool.map(write, "abc"))
    assert len(visible(tmp_path)) == 61
    for path in tmp_path.glob("*.csv"):
        assert store.read_listed(path).decode() == path.stem[2:]


@pytest.mark.parametrize("killed", ["a.csv", store.MANIFEST])
def test_the_next_writer_removes_what_a_killed_one_left(tmp_path, killed):
    code = f"""
import os, signal
from vsp import store
replace = os.replace
def die(one, other):
    if os.path.basename(other) == {killed!r}:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(one, other)
os.replace = die
store.write_listed({str(tmp_path / "a.csv")!r}, "1")
"""
    subprocess.run([sys.executable, "-c", code])
    somebodys = tmp_path / ".a-notes.csv"
    somebodys.write_text("mine")
    assert len(list(tmp_path.glob(store.TEMPORARY))) == 1
    store.write_listed(tmp_path / "a.csv", "2")
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", store.MANIFEST, somebodys.name}
    assert store.read_listed(tmp_path / "a.csv") == b"2"


@pytest.mark.parametrize(
    "read", [store.read_sealed, store.read_listed, store.read_table], ids=lambda read: read.__name__
)
def test_what_stands_in_the_place_of_a_file(tmp_path, read):
    path = tmp_path / "x"
    with pytest.raises(FileNotFoundError, match="x: no such file; "):
        read(path)
    path.mkdir()
    with pytest.raises(DamagedFile, match="x: is a folder or a device, expected a file"):
        read(path)
    path.rmdir()
    os.mkfifo(path)  # reading it would never end
    with pytest.raises(DamagedFile, match="x: is a folder or a device, expected a file"):
        read(path)
    path.unlink()
    path.symlink_to(tmp_path / "nothing")
    with pytest.raises(FileNotFoundError, match="x: no such file, but a link to .*nothing; "):
        read(path)
    path.unlink()
    path.symlink_to(path)
    with pytest.raises(OSError, match="x"):
        read(path)
    path.unlink()
    path.touch()
    with pytest.raises(DamagedFile, match="x: SHA-256 is e3b0c44298fc1c14"):
        read(path)


def test_a_link_to_a_file_is_read(table):
    elsewhere = table.rename(table.parents[0] / "elsewhere")
    table.symlink_to(elsewhere)
    assert store.read_table(table)["x"][0] == 1


@pytest.mark.parametrize(
    "payload",
    [b"", b"\x80\x04N.", b"\xff" * 8, (2).to_bytes(8, "little") + b"{}", (2).to_bytes(8, "little") + b"[]"],
)
def test_a_seal_alone_does_not_make_a_file_ours(tmp_path, payload):
    store.write_sealed(tmp_path / "x", payload)
    assert store.read_sealed(tmp_path / "x") == payload
    with pytest.raises(DamagedFile, match="x: sealed, but not what `save` writes"):
        load(tmp_path / "x", kind="Thing")


def test_where_there_is_a_manifest_the_card_is_listed_too(tmp_path):
    path, card = tmp_path / "x.safetensors", tmp_path / "x.json"
    write_carded(path, b"weights", {"task": "t", "score": 16.6})
    card.write_bytes(card.read_bytes().replace(b"16.6", b"16.7"))
    with pytest.raises(DamagedFile, match="x.json: SHA-256"):
        read_carded(path)
    (tmp_path / MANIFEST).unlink()
    assert read_carded(path)[1]["score"] == 16.7  # nothing says otherwise


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


def holds(lock, **options):
    """A process that holds `lock`."""
    code = f"from vsp.store import alone\nwith alone({str(lock)!r}, 'x'):\n  print(1, flush=True)\n  input()"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, **options)
    process.stdout.readline()
    return process


def test_one_after_the_other(tmp_path, capfd):
    """The second waits, says so, and comes in when the first is killed."""
    lock = tmp_path / "build" / "lock"
    first = holds(lock)
    threading.Timer(0.3, first.kill).start()
    with store.alone(lock, "writes here"):
        assert first.wait() == -signal.SIGKILL
    assert capfd.readouterr().err == "another run writes here: waiting for it to end\n"
    with store.alone(lock, "writes here"):
        assert capfd.readouterr().err == ""


def test_those_of_our_group_that_hold_a_lock_are_ended_and_nobody_else(tmp_path):
    ours, anothers = holds(tmp_path / "a"), holds(tmp_path / "b", start_new_session=True)
    ends = holds(tmp_path / "elsewhere" / "c")  # of our group, but it holds nothing in the folder
    (tmp_path / "d").write_text(str(ends.pid))  # any more
    with store.alone(tmp_path / "e", "writes here"):
        store.end_others(tmp_path)
    assert ours.wait(10) == -signal.SIGTERM
    for spared in (anothers, ends):
        spared.communicate(b"\n", 10)
        assert spared.returncode == 0
