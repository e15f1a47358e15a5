"""A binary heap of numbers (Williams, 1964) in two arrays: a list of tuples would be asked for its type at each step.

A heap is (keys (n), nodes (n)), of which the first `size` entries are in it; the least is entry 0. Of equal keys the
least node comes first, so that the order in which entries come out depends on nothing but what is in it.
"""

import numpy as np

from nerfnav.compiled import kernel


@kernel(inline=True)
def push(heap, size, key, node):
    """Add an entry to a heap that holds `size` and has room for it."""
    keys, nodes = heap
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] < key or (keys[above] == key and nodes[above] <= node):
            break
        keys[at], nodes[at] = keys[above], nodes[above]
        at = above
    keys[at], nodes[at] = key, node


@kernel(inline=True)
def pop(heap, size):
    """Take the least entry out of a heap, in which `size` entries are left."""
    keys, nodes = heap
    key, node = keys[size], nodes[size]
    at, below = 0, 1
    while below < size:
        beside = below + 1
        if beside < size and (
            keys[beside] < keys[below] or (keys[beside] == keys[below] and nodes[beside] < nodes[below])
        ):
            below = beside
        if key < keys[below] or (key == keys[below] and node <= nodes[below]):
            break
        keys[at], nodes[at] = keys[below], nodes[below]
        at, below = below, 2 * below + 1
    keys[at], nodes[at] = key, node


@kernel(inline=True)
def grown(heap):
    """The same heap with room for twice as many."""
    keys, nodes = heap
    count = keys.shape[0]
    more_keys, more_nodes = np.empty(2 * count), np.empty(2 * count, np.int64)
    more_keys[:count], more_nodes[:count] = keys, nodes
    return more_keys, more_nodes
