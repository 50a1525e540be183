"""vsp.environment: what is not as it was when the set-up ended."""

import json

import pytest

from vsp import environment


@pytest.fixture
def built(tmp_path, monkeypatch):
    """A folder with a lock, a project that asks for two packages, and an environment that has three."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".venv" / "lib").mkdir(parents=True)
    (tmp_path / "environment.lock").write_text("Fast-Maths==1.0\n")
    (tmp_path / "pyproject.toml").write_text(
        '[project]\ndependencies = ["fast_maths[all]>=1"]\noptional-dependencies = { test = ["Checks"] }\n'
    )
    for name in ("Fast.Maths", "checks", "more"):
        install(tmp_path, name)
    real = environment.distributions
    monkeypatch.setattr(environment, "distributions", lambda: real(path=[str(tmp_path / ".venv" / "lib")]))
    monkeypatch.setattr("sys.argv", ["environment.py", "--built"])
    assert environment.main() is None
    monkeypatch.setattr("sys.argv", ["environment.py"])
    return tmp_path


def install(folder, name, version="1.0"):
    lib = folder / ".venv" / "lib"
    card = lib / f"{name}-{version}.dist-info"
    card.mkdir()
    (card / "METADATA").write_text(f"Name: {name}\nVersion: {version}\n")
    (lib / f"{name}.py").write_text("12345")
    (card / "RECORD").write_text(f"{name}.py,sha256=x,5\n{name}.pyc,,\n")


def test_as_built_and_with_more(built):
    assert environment.changes() == [] and environment.main() is None
    install(built, "later")
    assert environment.changes() == []


def remove(lib, name):
    for path in (lib / f"{name}-1.0.dist-info").iterdir():
        path.unlink()
    (lib / f"{name}-1.0.dist-info").rmdir()


FAULTS = {
    "lock": (lambda f: (f / "environment.lock").write_text("x"), "environment.lock has changed"),
    "not whole": (lambda f: (f / ".venv/built-from").unlink(), "its set-up did not end"),
    "torn": (lambda f: (f / ".venv/built-from").write_text('{"lock"'), "its set-up did not end"),
    "missing": (lambda f: remove(f / ".venv/lib", "more"), "more is missing"),
    "larger": (lambda f: (f / ".venv/lib/checks.py").write_text("123456"), "checks.py is damaged"),
    "no file": (lambda f: (f / ".venv/lib/checks.py").unlink(), "checks.py is damaged"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_change(built, fault):
    spoil, words = FAULTS[fault]
    spoil(built)
    assert environment.changes() == [words] == [environment.main()]


def test_another_version_and_many_changes_in_one_line(built):
    for name in ("Fast.Maths", "more"):
        remove(built / ".venv" / "lib", name)
        install(built, name, "2.0")
    assert environment.changes() == ["fast-maths is 2.0, not 1.0", "more is 2.0, not 1.0"]
    for name in ("Fast.Maths", "checks"):
        (built / ".venv" / "lib" / f"{name}.py").unlink()
    assert environment.main().endswith("; ...") and environment.main().count(";") == 3


def test_another_folder(built, monkeypatch):
    moved = built.parent / f"{built.name}, moved"
    built.rename(moved)
    monkeypatch.chdir(moved)
    assert environment.changes()[0] == f"it was set up in {built}"


def test_a_package_that_the_lock_has_lost(built, monkeypatch):
    """It is not noted as whole."""
    (built / ".venv" / "built-from").unlink()
    remove(built / ".venv" / "lib", "checks")
    monkeypatch.setattr("sys.argv", ["environment.py", "--built"])
    assert "environment.lock lacks Checks, which pyproject.toml asks for" in environment.main()
    assert not (built / ".venv" / "built-from").exists()


def test_the_note_is_readable(built):
    note = json.loads((built / ".venv" / "built-from").read_text())
    assert note["packages"] == {"checks": "1.0", "fast-maths": "1.0", "more": "1.0"} and note["folder"] == str(built)
