import shutil
import subprocess

import pytest

from vsp import manifest, store


@pytest.mark.parametrize("folder", manifest.FOLDERS, ids=lambda folder: folder.name)
def test_the_committed_manifests_list_every_file_there(folder):
    listed = (folder / store.MANIFEST).read_text().splitlines()
    files = [path for path in folder.iterdir() if path.is_file() and path.name != store.MANIFEST]
    assert listed == sorted((f"{store.sha256(path)}  {path.name}" for path in files), key=lambda line: line[66:])
    for tool in ("sha256sum", "shasum"):
        if shutil.which(tool):  # the standard tools agree
            subprocess.run([tool, "-c", store.MANIFEST], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def test_make_manifest_lists_the_folders_anew(tmp_path, monkeypatch, capsys):
    store.write_listed(tmp_path / "x.csv", "x\n1\n")
    (tmp_path / "x.csv").write_text("x\n2\n")
    monkeypatch.setattr("sys.argv", ["x", str(tmp_path)])
    manifest.main()
    assert store.read_table(tmp_path / "x.csv")["x"][0] == 2
    assert capsys.readouterr().out == f"{tmp_path / 'MANIFEST.sha256'}: 1 files\n"
    monkeypatch.setattr("sys.argv", ["x", str(tmp_path / "none")])
    with pytest.raises(SystemExit):
        manifest.main()
    assert "none: no such folder" in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["x"])
    monkeypatch.setattr(manifest, "FOLDERS", (tmp_path,))
    manifest.main()
    assert capsys.readouterr().out
