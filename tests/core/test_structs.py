"""Records of tensors."""

from dataclasses import dataclass

import pytest
import torch

from nerfnav.core.structs import TensorStruct
from nerfnav.geometry import so3
from nerfnav.robots.state import Motion, RigidState


@dataclass(frozen=True)
class Inner(TensorStruct):
    values: torch.Tensor


@dataclass(frozen=True)
class Outer(TensorStruct):
    inner: Inner
    more: torch.Tensor
    name: str = "kept"


def outer(start: float) -> Outer:
    values = torch.arange(6.0).reshape(3, 2) + start
    return Outer(Inner(values), 10 * values[:, 0])


def test_map_reaches_nested_tensors_and_nothing_else():
    doubled = outer(0).map(lambda tensor: 2 * tensor)
    assert doubled.inner.values[2].tolist() == [8, 10]
    assert doubled.more.tolist() == [0, 40, 80]
    assert doubled.name == "kept"


@pytest.mark.parametrize("index", [0, -1, slice(1, None), torch.tensor([2, 0]), torch.tensor([True, False, True])])
def test_indexing_a_record_indexes_its_tensors(index: object):
    record = outer(0)
    assert torch.equal(record[index].inner.values, record.inner.values[index])
    assert torch.equal(record[index].more, record.more[index])


def test_stack_and_cat_join_all_tensors_along_any_dimension():
    records = [outer(0), outer(1)]
    assert Outer.stack(records).inner.values.shape == (2, 3, 2)
    assert Outer.stack(records, 1).inner.values.shape == (3, 2, 2)
    assert Outer.cat(records).more.tolist() == [0, 20, 40, 10, 30, 50]
    assert Outer.cat(records).name == "kept"


def test_joining_nothing_is_refused():
    with pytest.raises(ValueError, match="empty"):
        Outer.stack([])


def test_detaching_and_casting_reach_every_tensor():
    record = outer(0).map(torch.Tensor.requires_grad_)
    assert record.inner.values.requires_grad
    assert not record.detach().inner.values.requires_grad and not record.detach().more.requires_grad
    assert record.to(torch.float64).more.dtype == torch.float64


def test_records_that_hold_records_keep_their_types():
    states = RigidState.stack([RigidState.at_rest((float(step), 0, 0)) for step in range(4)])
    motion = Motion(states, torch.zeros(3, 2), 0.1)
    late = motion.states[2:]
    assert isinstance(late, RigidState) and late.position[:, 0].tolist() == [2, 3]
    assert motion.to(torch.float64).dt == 0.1
    torch.testing.assert_close(so3.yaw_of(late.rotation), torch.zeros(2))
