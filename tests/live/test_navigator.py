"""The navigator before stamps that do not follow each other; what tracks is a double, which knows nothing."""

import pytest
import torch

from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.live import Goal, Guidance, Navigator, Order, Setpoint
from nerfnav.live.navigator import OLD
from nerfnav.robots import Quadrotor
from nerfnav.tracking import Frame, TrackedFrame, TrackStatus
from tests.tracking.walks import CAMERA, field

PICTURE = torch.zeros(CAMERA.height, CAMERA.width, 3, dtype=torch.uint8)


class Lost:
    """Counts what it sees, and how often it is to forget."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.actions: list[object] = []
        self.forgotten = 0

    def forget(self) -> None:
        self.forgotten += 1

    def observe(self, frame: Frame, action: object) -> TrackedFrame:
        self.times.append(frame.time)
        self.actions.append(action)
        return TrackedFrame(frame.time, frame.name, TrackStatus.SEARCHING, None, FORWARD_MOUNT, 0.0)


@pytest.mark.parametrize(("stamps", "used", "word"), [
    ((100.0, 100.1, 1e9, 100.2, 200.0), [100.0, 100.1, 100.2, 200.0], "wrong stamp"),
    ((100.0, 100.1, 0.0, 0.1, 0.2), [100.0, 100.1, 0.1, 0.2], "began anew"),
    ((5.0, 1.6e9, 1.6e9 + 0.1, 1.6e9 + 0.2), [5.0, 1.6e9 + 0.1, 1.6e9 + 0.2], "began anew"),
])  # fmt: skip
def test_pictures_are_used_again_after_a_wrong_stamp_and_after_a_new_clock(
    stamps: tuple[float, ...], used: list[float], word: str
) -> None:
    said: list[str] = []
    navigator, lost = Navigator(field(), Quadrotor(), CAMERA, log=said.append), Lost()
    navigator._tracker = lost  # pyright: ignore[reportAttributeAccessIssue]
    answers = [navigator.see(PICTURE, stamp) for stamp in stamps]
    assert lost.times == used == [answer.time for answer in answers if answer.status != OLD]
    assert lost.forgotten == (word == "began anew")
    assert len(said) == 1 and word in said[0] and "\n" not in said[0]
    refused = [answer.sentence for answer in answers if answer.status == OLD]
    assert len(refused) == 1 and "the next picture tells whether the clock began anew" in refused[0]


@pytest.mark.parametrize("held", [False, True])
def test_a_vehicle_that_holds_is_not_predicted_along_the_guidance_that_it_did_not_take(held: bool) -> None:
    navigator, lost = Navigator(field(), Quadrotor(), CAMERA), Lost()
    navigator._tracker = lost  # pyright: ignore[reportAttributeAccessIssue]
    navigator.see(PICTURE, 1.0)
    way = tuple(Setpoint(t, (t, 0.0, 0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0) for t in (1.0, 2.0))
    navigator._followed = Guidance(Order.FOLLOW, "", way)
    navigator.see(PICTURE, 1.5, Goal((2.0, 0.0, 0.5)), held=held)
    assert lost.actions[0] is None and (lost.actions[1] is None) == held
