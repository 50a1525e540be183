"""Sealed files come back exactly, or are refused before anything is parsed."""

import numpy as np
import pytest
from support import flipped

from vsp.run.atomic import DamagedFile
from vsp.run.sealed import load_arrays, read_sealed, save_arrays, write_sealed

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2], dtype=np.int32), "none": np.zeros((0, 2))}
ABOUT = {"kind": "Thing", "task": "x", "n": 3, "nested": {"list": [1.5, None, True]}}


def test_a_sealed_file_comes_back_exactly(tmp_path):
    path = tmp_path / "deep" / "er" / "x.run"
    transposed = {"t": ARRAYS["a"].T, "s": ARRAYS["a"][:, ::2]}  # in other orders of memory
    save_arrays(path, ARRAYS | transposed, ABOUT)
    arrays, about = load_arrays(path, kind="Thing")
    assert about == ABOUT and arrays.keys() == (ARRAYS | transposed).keys()
    assert all(arrays[k].dtype == v.dtype and np.array_equal(arrays[k], v) for k, v in (ARRAYS | transposed).items())


def test_the_same_content_gives_the_same_bytes(tmp_path):
    save_arrays(tmp_path / "x", ARRAYS, ABOUT)
    save_arrays(tmp_path / "y", ARRAYS, dict(reversed(ABOUT.items())))
    assert (tmp_path / "x").read_bytes() == (tmp_path / "y").read_bytes()


def test_one_flipped_bit_or_another_length_is_found(tmp_path):
    path, said = tmp_path / "x", "x: damaged.* SHA-256 is [0-9a-f]{64}, its first line .*delete it"
    save_arrays(path, ARRAYS, ABOUT)
    content = path.read_bytes()
    altered = [flipped(content, 8 * n + n % 8) for n in range(len(content))]
    cut = [content[:n] for n in (0, 64, 65, 66, len(content) - 1)]
    for damaged in [*altered, *cut, content + b"\0", b"of another origin"]:
        path.write_bytes(damaged)
        with pytest.raises(DamagedFile, match=said) as found:
            load_arrays(path, kind="Thing")
        assert "\n" not in str(found.value)


def test_another_kind_is_named(tmp_path):
    save_arrays(tmp_path / "x", ARRAYS, ABOUT)
    with pytest.raises(DamagedFile, match="holds a 'Thing', expected a 'Run'"):
        load_arrays(tmp_path / "x", kind="Run")


def safetensors(about: str) -> bytes:
    from safetensors.numpy import save

    return save({"a": np.zeros(1)}, metadata={"about": about})


@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize(
    "payload",
    [b"", b"\x80\x04N.", (2).to_bytes(8, "little") + b"[]", safetensors("null"), safetensors("[" * 100_000)],
    ids=range(5),
)
def test_a_seal_alone_does_not_make_a_file_ours(tmp_path, payload):
    write_sealed(tmp_path / "x", payload)
    assert read_sealed(tmp_path / "x") == payload
    with pytest.raises(DamagedFile, match="x: right checksum, but `save_arrays` did not write it"):
        load_arrays(tmp_path / "x", kind="Thing")
