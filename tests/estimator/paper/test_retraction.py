"""The retraction, by nerfnav or by LieTorch."""

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import scipy.linalg
import torch
from torch import Tensor

from nerfnav.estimator.paper.retraction import choose_retraction, princeton_lietorch, retract, retraction_backend
from nerfnav.geometry import so3
from nerfnav.robots.state import RigidState
from tests.estimator.places import draws

STATE = RigidState.at_rest((0.1, 0.2, 0.3), 0.5).retract(torch.randn(12, generator=draws(0)))
TANGENT = 0.3 * torch.randn(12, generator=draws(1))


class Rotations:
    """LieTorch's SO3 as far as it is used: `SO3.exp(batch of vectors).matrix()` of 4 x 4."""

    def __init__(self, matrices: Tensor) -> None:
        self._matrices = matrices

    @classmethod
    def exp(cls, vectors: Tensor) -> "Rotations":
        turns = [torch.from_numpy(scipy.linalg.expm(so3.hat(vector).numpy())) for vector in vectors]
        matrices = torch.eye(4).repeat(len(turns), 1, 1)
        matrices[:, :3, :3] = torch.stack(turns)
        return cls(matrices)

    def matrix(self) -> Tensor:
        return self._matrices


def library(**parts: Any) -> ModuleType:
    module = ModuleType("lietorch")
    for name, part in parts.items():
        setattr(module, name, part)
    return module


@pytest.fixture(autouse=True)
def look_afresh():
    princeton_lietorch.cache_clear()
    yield
    princeton_lietorch.cache_clear()


def test_lietorch_and_nerfnav_retract_alike():
    theirs = choose_retraction(library(SE3=SimpleNamespace(), SO3=Rotations))(STATE, TANGENT)
    ours = choose_retraction(None)(STATE, TANGENT)
    for part in ("position", "velocity", "rotation", "body_rate"):
        torch.testing.assert_close(getattr(theirs, part), getattr(ours, part), atol=1e-5, rtol=0)


def test_the_retraction_is_that_of_the_state():
    torch.testing.assert_close(retract(STATE, TANGENT).rotation, STATE.retract(TANGENT).rotation, atol=1e-6, rtol=0)


def test_a_thousand_steps_do_not_leave_the_manifold():
    state = STATE
    for _ in range(1_000):
        state = retract(state, 0.01 * TANGENT)
    torch.testing.assert_close(state.rotation @ state.rotation.T, torch.eye(3), atol=1e-6, rtol=0)


def test_princetons_lietorch_is_used_where_it_is_installed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "lietorch", library(SE3=SimpleNamespace(), SO3=Rotations))
    assert retraction_backend() == "LieTorch"


def test_the_other_library_of_that_name_is_ignored(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "lietorch", library(Tangent=SimpleNamespace()))
    assert retraction_backend() == "nerfnav"


def test_nerfnav_retracts_where_lietorch_is_missing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "lietorch", None)
    assert princeton_lietorch() is None
    assert retraction_backend() == "nerfnav"
