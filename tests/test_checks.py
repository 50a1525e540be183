import numpy as np
import pytest

from vsp.checks import check_array, check_finite, check_seed


@pytest.mark.filterwarnings("error")
def test_numbers_whose_squares_overflow_are_finite_and_the_first_wrong_value_is_shown():
    values = np.full((3, 4), 1e300)[:, ::2]
    assert np.array_equal(check_finite("weights", values), values)
    values[2, 1] = -np.inf
    for wrong, said in (
        (values, r"hold -inf at index \(2, 1\)"), (-np.inf, r"hold -inf at index \(\), expected finite numbers"),
        (["a"], "have type <U1, expected numbers"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"weights {said}"):
            check_finite("weights", wrong)


def test_a_wrong_shape_shows_both():
    for shape in ((0, 2), (7, 2)):
        assert check_array("weights", np.zeros(shape), (-1, 2)).shape == shape
    for shape in ((2, 3), (2,), (1, 2, 2)):
        with pytest.raises(ValueError) as caught:
            check_array("weights", np.zeros(shape), (-1, 2))
        assert str(caught.value) == f"weights have shape {shape}, expected (n, 2)"


def test_a_seed_may_be_an_integer_of_numpy():
    check_seed(np.int64(3))
