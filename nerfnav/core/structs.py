"""Tensor records: a base of frozen dataclasses that maps, indexes, stacks and moves all of their tensors at once."""

from collections.abc import Callable, Sequence
from dataclasses import Field, fields, replace
from typing import Any, ClassVar, TypeVar

import torch
from torch import Tensor

S = TypeVar("S", bound="TensorStruct")


class TensorStruct:
    """Base of frozen dataclasses whose tensor fields share their leading (batch or time) dimensions.

    Nested TensorStructs are followed; fields that are neither pass through unchanged.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def map(self: S, function: Callable[[Tensor], Tensor]) -> S:
        """The same record with `function` applied to every tensor in it."""
        return _combine([self], lambda tensors: function(*tensors))

    def __getitem__(self: S, index: Any) -> S:
        """Index the leading dimensions of every tensor, as `tensor[index]` does."""
        return self.map(lambda tensor: tensor[index])

    def to(self: S, *args: Any, **kwargs: Any) -> S:
        """Move or cast every tensor, as `torch.Tensor.to` does."""
        return self.map(lambda tensor: tensor.to(*args, **kwargs))

    def detach(self: S) -> S:
        """The same values without their autograd history."""
        return self.map(torch.Tensor.detach)

    @classmethod
    def stack(cls: type[S], records: Sequence[S], dim: int = 0) -> S:
        """One record whose tensors are those of `records`, stacked along a new dimension.

        Fields that are not tensors are taken from the first record. Raises ValueError when `records` is empty.
        """
        return _combine(records, lambda tensors: torch.stack(tensors, dim))

    @classmethod
    def cat(cls: type[S], records: Sequence[S], dim: int = 0) -> S:
        """One record whose tensors are those of `records`, joined along an existing dimension."""
        return _combine(records, lambda tensors: torch.cat(tensors, dim))


def _combine(records: Sequence[Any], join: Callable[[list[Tensor]], Tensor]) -> Any:
    if not records:
        raise ValueError("cannot combine an empty sequence of records")
    first = records[0]
    changed: dict[str, Any] = {}
    for field in fields(first):
        value = getattr(first, field.name)
        parts = [getattr(record, field.name) for record in records]
        if isinstance(value, Tensor):
            changed[field.name] = join(parts)
        elif isinstance(value, TensorStruct):
            changed[field.name] = _combine(parts, join)
    return replace(first, **changed)
