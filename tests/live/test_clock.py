"""The clock of a vehicle: which stamps are used, and what is said of the others."""

import pytest

from nerfnav.live.clock import Stamp, VehicleClock, format_stamp


def used(*times: float) -> tuple[list[float], list[str]]:
    """Times that are used, and the sentences."""
    clock, taken, said = VehicleClock(), [], []
    for time in times:
        if clock.judge(time) in (Stamp.NEXT, Stamp.RESTARTED):
            taken.append(time)
            if (sentence := clock.use(time)) is not None:
                said.append(sentence)
    return taken, said


@pytest.mark.parametrize("wrong", [1e9, 0.0, -1e300, 1e300, 50.0])
def test_one_wrong_stamp_is_left_out_and_named_once(wrong: float) -> None:
    taken, said = used(100.0, 100.1, wrong, 100.2, 200.0)
    assert taken == [100.0, 100.1, 100.2, 200.0]
    assert len(said) == 1 and "wrong stamp was not used" in said[0] and format_stamp(wrong) in said[0]


@pytest.mark.parametrize("begun", [0.0, 1.6e9])
def test_a_clock_that_begins_anew_is_followed_from_its_second_stamp_on(begun: float) -> None:
    taken, said = used(100.0, 100.1, begun, begun + 0.1, begun + 0.2)
    assert taken == [100.0, 100.1, begun + 0.1, begun + 0.2]
    assert len(said) == 1 and "began anew" in said[0]


def test_after_a_wrong_first_stamp_the_true_clock_is_followed() -> None:
    assert used(1e9, 5.0, 5.1, 5.2)[0] == [1e9, 5.1, 5.2]


@pytest.mark.parametrize("times", [(100.0, 100.0), (100.3, 100.1, 100.2), (100.3, 99.4, 99.5)])
def test_pictures_that_come_late_are_no_new_clock(times: tuple[float, ...]) -> None:
    assert used(*times, 100.4) == ([times[0], 100.4], [])


def test_two_clocks_in_turn_never_make_one_begin_anew() -> None:
    taken, said = used(*(time for step in range(5) for time in (100 + 0.1 * step, 5 + 0.1 * step)))
    assert taken == [100 + 0.1 * step for step in range(5)] and len(said) == 4
