"""Checks of types and shapes: they are made in each test, of the first calls of each function and dataclass."""

import jaxtyping
import pytest
import torch

from nerfnav.geometry import so3
from nerfnav.robots import RigidState
from tests.shape_checks import CALLS, begin_test


def test_a_wrong_shape_is_refused() -> None:
    with pytest.raises(jaxtyping.TypeCheckError, match=r"so3\.exp"):
        so3.exp(torch.zeros(2))
    with pytest.raises(jaxtyping.TypeCheckError, match="RigidState"):
        RigidState(torch.zeros(2), torch.zeros(3), torch.eye(3), torch.zeros(3))


def test_later_calls_in_a_test_are_not_checked_and_the_first_in_the_next_are() -> None:
    for _ in range(CALLS):
        so3.exp(torch.zeros(3))
    with pytest.raises(ValueError):  # of the function itself
        so3.exp(torch.zeros(2))
    begin_test()
    with pytest.raises(jaxtyping.TypeCheckError):
        so3.exp(torch.zeros(2))
