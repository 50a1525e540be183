"""Listed files are compared with their checksums before anything is parsed."""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import pytest
from support import called, flipped, visible

from vsp.paper.results import read_results
from vsp.run import manifest
from vsp.run.atomic import DamagedFile, sha256
from vsp.run.listed import MANIFEST, read_listed, write_listed


@pytest.fixture
def table(tmp_path):
    """A listed table, and another one beside it."""
    for name in ("a.csv", "b.csv"):
        write_listed(tmp_path / name, f"x,y\n1,{name}\n")
    return tmp_path / "b.csv"


def test_a_listed_table_comes_back(table):
    assert read_listed(table) == table.read_bytes() == b"x,y\n1,b.csv\n"
    assert read_results("b", table.parent).to_dict("list") == {"x": [1], "y": ["b.csv"]}
    lines = [f"{sha256(table.with_name(name))}  {name}\n" for name in ("a.csv", "b.csv")]
    assert (table.parent / MANIFEST).read_text() == "".join(lines)
    write_listed(table, b"x\n2\n")
    assert read_listed(table) == b"x\n2\n" and visible(table.parent) == [MANIFEST, "a.csv", "b.csv"]


def test_one_flipped_bit_or_a_cut_in_a_listed_file_or_its_line_is_found_before_it_is_parsed(table, monkeypatch):
    monkeypatch.setattr("pandas.read_csv", lambda *given: pytest.fail("parsed"))
    manifest = table.parent / MANIFEST
    line = manifest.read_bytes().index(b"\n") + 1  # of b.csv: the second one
    for path, first in ((table, 0), (manifest, line)):
        content = path.read_bytes()
        damaged = [flipped(content, bit) for bit in range(8 * first, 8 * len(content))]
        for content_then in damaged + [content[:size] for size in range(len(content))]:
            path.write_bytes(content_then)
            with pytest.raises(DamagedFile):
                read_results("b", table.parent)
        path.write_bytes(content)
    assert read_listed(table)


def test_an_altered_file_is_named_with_the_ways_out(table, tmp_path):
    expected = sha256(table)
    table.write_text("x\n3\n")
    with pytest.raises(DamagedFile) as found:
        read_listed(table)
    assert str(found.value) == (
        f"{table}: SHA-256 is {sha256(table)}, MANIFEST.sha256 lists {expected}: if the file is correct, "
        f"`python -m vsp.run.manifest {table.parent}` accepts it"
    )
    (tmp_path / "c.csv").write_text("x\n")
    with pytest.raises(DamagedFile, match=r"c.csv: .*MANIFEST.sha256 lists no such file"):
        read_listed(tmp_path / "c.csv")
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(DamagedFile, match="lists no such file"):
        read_listed(table)


def test_somebody_accepts_files_as_they_are(table, tmp_path, capsys):
    """By the command, whatever the manifest was."""
    table.write_text("x\n3\n")
    (tmp_path / "c.csv").write_text("x\n4\n")
    (tmp_path / "a.csv").unlink()
    (tmp_path / ".DS_Store").write_text("")
    (tmp_path / MANIFEST).write_text("rubbish")
    called(manifest.main, tmp_path)
    assert capsys.readouterr().out == f"{tmp_path / MANIFEST}: 2 files\n"
    assert [read_listed(tmp_path / name) for name in ("b.csv", "c.csv")] == [b"x\n3\n", b"x\n4\n"]
    assert [line[66:] for line in (tmp_path / MANIFEST).read_text().splitlines()] == ["b.csv", "c.csv"]


def test_of_several_writers_none_loses_a_line(tmp_path):
    def write(name):
        for i in range(20):
            write_listed(tmp_path / f"{name}-{i}.csv", f"{i}")

    with ThreadPoolExecutor() as pool:  # the lock is between open files, so threads are as good as processes
        list(pool.map(write, "abc"))
    assert len(visible(tmp_path)) == 61
    for path in tmp_path.glob("*.csv"):
        assert read_listed(path).decode() == path.stem[2:]


# The committed manifests


@pytest.mark.parametrize("folder", manifest.FOLDERS, ids=lambda folder: folder.name)
def test_the_committed_manifests_list_every_file_there(folder):
    listed = (folder / MANIFEST).read_text().splitlines()
    files = [path for path in folder.iterdir() if path.is_file() and path.name != MANIFEST]
    assert listed == sorted((f"{sha256(path)}  {path.name}" for path in files), key=lambda line: line[66:])
    for tool in ("sha256sum", "shasum"):
        if shutil.which(tool):  # the standard tools agree
            subprocess.run([tool, "-c", MANIFEST], cwd=folder, check=True, stdout=subprocess.DEVNULL)
