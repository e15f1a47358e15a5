"""Messages of errors: they name the input, and stay short whatever a damaged file holds."""

import pytest

from nerfnav.core.errors import InvalidInputError, InvalidNumberError, NerfnavError, naming_input


def test_an_error_gets_the_name_of_its_input_where_it_has_none() -> None:
    with pytest.raises(InvalidInputError, match=r"^a/scan: too few photographs$"), naming_input("a/scan"):
        raise InvalidInputError("too few photographs")
    with pytest.raises(InvalidInputError, match=r"^b/scan is empty$"), naming_input("a/scan"):
        raise InvalidInputError("b/scan is empty")
    with pytest.raises(InvalidInputError, match=r"^\.: too few photographs$"), naming_input("."):
        raise InvalidInputError("too few photographs")


def test_an_error_that_names_an_option_keeps_its_message() -> None:
    with pytest.raises(InvalidNumberError, match=r"^voxel must be a number above 0, not -1$"), naming_input("a/scan"):
        raise InvalidNumberError("voxel", "a number above 0", -1.0)


def test_a_long_word_of_a_damaged_file_is_cut() -> None:
    message = str(NerfnavError(f"the picture a{'9' * 5000}.png is missing"))
    assert message.startswith("the picture a999") and message.endswith(".png is missing") and len(message) < 300
    assert str(NerfnavError("w" * 300)) == "w" * 300
