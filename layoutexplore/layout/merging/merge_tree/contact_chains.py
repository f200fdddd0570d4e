"""The contacts of each region while regions merge, and what becomes of them when two do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32, Mask
from layoutexplore.layout.merging.graph_tables import EDGE, add_edge, half_edges
from layoutexplore.layout.merging.merge_tree.contest import Contest, drop_contact


class Chains(NamedTuple):
    """The contacts of each region, as chains of half-edges: 2 e and 2 e + 1 are contact e at its two ends.

    Attributes:
        first: int32 (k + 1,), of each region's chain, -1 for none.
        last: int32 (k + 1,), of each region's chain.
        links: int32 (2 m,), the half-edge behind each, -1 for none.
        dead: bool (m,), contacts that are no more: they are taken from a chain when it is followed.
        at: int32 (k + 1,), row of the contact with each region while two chains are compared, else -1.
    """

    first: Ints32
    last: Ints32
    links: Ints32
    dead: Mask
    at: Ints32


@njit(cache=True, nogil=True)
def chains_of(ends: Ints32, count: int) -> Chains:
    """The chains of `count` regions."""
    halves = half_edges(ends, np.ones(len(ends), np.bool_), count)
    dead, nowhere = np.zeros(len(ends), np.bool_), np.full(count, -1, np.int32)
    return Chains(halves.first, halves.last, halves.links, dead, nowhere)


@njit(cache=True, nogil=True)
def _mark(a: int, ends: Ints32, chains: Chains, clear: bool) -> None:
    """Write the contacts of region a to `at`, or -1 where they stand; dead ones leave the chain."""
    before, h = -1, chains.first[a]
    while h >= 0:
        e, behind = h // 2, chains.links[h]
        if chains.dead[e]:
            if before < 0:
                chains.first[a] = behind
            else:
                chains.links[before] = behind
        else:
            chains.at[ends[e, 0] + ends[e, 1] - a] = -1 if clear else e
            before = h
        h = behind
    chains.last[a] = before


@njit(cache=True, nogil=True)
def move_contacts(a: int, b: int, ends: Ints32, edges: Floats, chains: Chains, contest: Contest) -> None:
    """Give the contacts of region b to region a, adding up those with one neighbour."""
    _mark(a, ends, chains, False)
    chains.dead[chains.at[b]] = True
    h = chains.first[b]
    while h >= 0:
        f = h // 2
        if not chains.dead[f]:
            n = ends[f, 0] + ends[f, 1] - b
            g = chains.at[n]
            # a neighbour of b alone keeps its row, now with a; one of both loses it
            if g < 0:
                ends[f, 0], ends[f, 1] = min(a, n), max(a, n)
                chains.at[n] = f
            else:
                add_edge(edges[g], edges[f])
                chains.dead[f] = True
                drop_contact(contest, f)
        h = chains.links[h]
    chains.at[b] = -1
    if chains.first[b] >= 0:
        if chains.last[a] < 0:
            chains.first[a] = chains.first[b]
        else:
            chains.links[chains.last[a]] = chains.first[b]
        chains.last[a] = chains.last[b]
    _mark(a, ends, chains, True)


@njit(cache=True, nogil=True)
def stale_contacts(a: int, edges: Floats, chains: Chains, gone: Mask, out: Ints32) -> int:
    """Write the contacts of region a that are to be asked about again to `out`; returns how many."""
    count = 0
    h = chains.first[a]
    while h >= 0:
        f = h // 2
        if not chains.dead[f] and edges[f, EDGE.open] > 0:
            gone[f] = False
            out[count] = f
            count += 1
        h = chains.links[h]
    return count
