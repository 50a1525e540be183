import numpy as np
import pytest

from vsp.checks import check_array, check_finite, check_seed


@pytest.mark.parametrize("values", [[1, 2], np.float32([1, 2]), np.uint8([1, 2]), np.array([1.0, 2.0])])
def test_numbers_become_float64(values):
    checked = check_finite("weights", values)
    assert checked.dtype == np.float64 and checked.tolist() == [1, 2]


@pytest.mark.filterwarnings("error")
def test_numbers_whose_squares_overflow_are_finite():
    values = np.full((3, 4), 1e300)[:, ::2]
    assert np.array_equal(check_finite("weights", values), values)
    values[2, 1] = -np.inf
    with pytest.raises(ValueError, match=r"weights hold -inf at index \(2, 1\)"):
        check_finite("weights", values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[1, 2], [3, np.nan]], r"weights hold nan at index \(1, 1\), expected finite numbers"),
        ([np.inf], r"weights hold inf at index \(0,\)"),
        (-np.inf, r"weights hold -inf at index \(\)"),
        (["a"], "weights have type <U1, expected numbers"),
        ([None, 1], "weights have type object"),
        ([1j], "weights have type complex128"),
        ([True], "weights have type bool"),
        (np.array(["2020-01-01"], dtype="M8[D]"), "weights have type datetime64"),
    ],
)
def test_the_first_offender_is_shown(values, message):
    with pytest.raises(ValueError, match=message):
        check_finite("weights", values)


@pytest.mark.parametrize(
    ("shape", "wanted", "shown"),
    [
        ((3,), (2,), r"\(2,\)"),
        ((2, 3), (-1, 2), r"\(n, 2\)"),
        ((2,), (-1, 2), r"\(n, 2\)"),
        ((1, 2, 2), (-1, 2), r"\(n, 2\)"),
    ],
)
def test_a_wrong_shape_shows_both(shape, wanted, shown):
    got = str(shape).replace("(", r"\(").replace(")", r"\)")
    with pytest.raises(ValueError, match=f"weights have shape {got}, expected {shown}"):
        check_array("weights", np.zeros(shape), wanted)


def test_a_right_shape_passes():
    assert check_array("weights", np.zeros((7, 2)), (-1, 2)).shape == (7, 2)
    assert check_array("weights", np.zeros((0, 2)), (-1, 2)).shape == (0, 2)


@pytest.mark.parametrize("seed", [0, 7, np.int64(3), 2**40])
def test_seeds_are_integers_from_zero_on(seed):
    check_seed(seed)


@pytest.mark.parametrize("seed", [None, -1, 0.5, "1", True])
def test_other_seeds_are_refused(seed):
    with pytest.raises(ValueError, match="seed is .*, expected an integer from 0 on"):
        check_seed(seed)
