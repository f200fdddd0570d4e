"""Which contact merges next: a tournament of all of them, played again where one changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32, Mask
from layoutexplore.layout.merging.graph_tables import EDGE


class Rest(NamedTuple):
    """What is too small for a room joins the neighbour it most likely belongs to.

    Attributes:
        small: What is smaller than this always does [m2].
        nook: What is smaller than this does [m2] ...
        level: ... while the log-odds are at least this.
        questions: When the classifier has been asked about so many pairs, merging ends.
    """

    small: float = 0.0
    nook: float = 0.0
    level: float = 0.0
    questions: int = 2**60


class Contest(NamedTuple):
    """The contacts that may merge next, in trees whose node 1 is the surest, of equal ones the first.

    A tree is an array: node n has the children 2 n and 2 n + 1, the leaves are the contacts, -1 is nobody.

    Attributes:
        odds: float64 (m,), of each contact.
        gone: bool (m,), contacts that are not to be merged as things are.
        surest: int32, tree of the contacts that are not gone.
        rest: int32, tree of those of them that have a region too small to stay by itself.
    """

    odds: Floats
    gone: Mask
    surest: Ints32
    rest: Ints32


@njit(cache=True, nogil=True)
def contest_of(edges: Floats) -> Contest:
    """One without entries; contacts across walls only never merge by themselves, but add up."""
    size = 1
    while size < len(edges):
        size *= 2
    return Contest(
        np.full(len(edges), -1e9),
        edges[:, EDGE.open] <= 0,
        np.full(2 * size, -1, np.int32),
        np.full(2 * size, -1, np.int32),
    )


@njit(cache=True, nogil=True)
def _play(tree: Ints32, odds: Floats, e: int, takes_part: bool) -> None:
    """Enter contact e, or take it out, and play its matches again."""
    node = len(tree) // 2 + e
    tree[node] = e if takes_part else -1
    node //= 2
    while node >= 1:
        one, other = tree[2 * node], tree[2 * node + 1]
        # of equal ones the left child wins, which has the lower indices
        tree[node] = one if other < 0 or (one >= 0 and odds[one] >= odds[other]) else other
        node //= 2


@njit(cache=True, nogil=True)
def drop_contact(contest: Contest, e: int) -> None:
    """Contact e is gone."""
    contest.gone[e] = True
    _play(contest.surest, contest.odds, e, False)
    _play(contest.rest, contest.odds, e, False)


@njit(cache=True, nogil=True)
def enter_contact(contest: Contest, e: int, odds: float, area: float, rest: Rest) -> None:
    """Enter contact e; the smaller of its regions has this many cells, and so are the areas of `rest`."""
    contest.odds[e] = odds
    _play(contest.surest, contest.odds, e, True)
    small = area < rest.small or (area < rest.nook and odds >= rest.level)
    _play(contest.rest, contest.odds, e, small)
