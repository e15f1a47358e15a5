"""The heap of searches gives the least first, of equal keys the least node, as a sorted list would."""

import numpy as np
import pytest

from nerfnav.core.jit import kernel
from nerfnav.planner.kernels.search import grown, pop, push


@kernel()
def sorted_by_heap(keys, nodes, early):
    """Entries in the order in which they come out; the first `early` of them are taken out and put back half way."""
    heap, size = (np.empty(4), np.empty(4, np.int64)), 0
    for n in range(keys.shape[0]):
        if size == heap[0].shape[0]:
            heap = grown(heap)
        push(heap, size, keys[n], nodes[n])
        size += 1
        if n == keys.shape[0] // 2:
            taken = np.empty(early), np.empty(early, np.int64)
            for m in range(early):
                taken[0][m], taken[1][m], size = heap[0][0], heap[1][0], size - 1
                pop(heap, size)
            for m in range(early):
                push(heap, size, taken[0][m], taken[1][m])
                size += 1
    found = np.empty(size), np.empty(size, np.int64)
    for n in range(keys.shape[0]):
        found[0][n], found[1][n], size = heap[0][0], heap[1][0], size - 1
        pop(heap, size)
    return found


@pytest.mark.parametrize("kinds", [3, 1000])  # many equal keys, and hardly any
@pytest.mark.parametrize("count", [1, 2, 7, 500])
def test_entries_come_out_in_order(count: int, kinds: int) -> None:
    draws = np.random.default_rng(count + kinds)
    keys, nodes = draws.integers(0, kinds, count) / 7, draws.integers(0, 50, count)
    found = sorted_by_heap(keys, nodes, count // 4)
    wanted = sorted(zip(keys.tolist(), nodes.tolist(), strict=True))
    assert list(zip(*(part.tolist() for part in found), strict=True)) == wanted
