"""Where a prior plan lies, tracked over an exploration: several hypotheses, one of them the best.

The first match searches everything. Later ones search again when the map has grown by a share, a few
orientations and scales a decision; in between the hypotheses are refined by what is new.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.priors.evidence import Evidence, seen_points, wall_direction
from layoutexplore.priors.fields import make_fields
from layoutexplore.priors.plan import PriorPlan
from layoutexplore.priors.refinement import Fit, Placement, fit_points, matrix_of, recentred, refine
from layoutexplore.priors.search import SCALE_STEP, Candidate, CoarseSearch, Slice, make_gains, slices
from layoutexplore.priors.warp import WarpedPlacement, bent

LEAST_AREA = 6.0
"""Square metres of seen floor from which a plan is looked for."""

GROWTH = 1.3
"""A search begins again when the seen floor has grown by this factor."""

HOPELESS = 150.0
"""Log-likelihood by which a hypothesis behind the first two may be worse than the best one and be kept."""

STEADY = 1.0
"""Metres by which the best hypothesis may move at a decision and be the same."""

KEPT, TRIED, TRIED_A_DECISION = 8, 32, 11
"""Hypotheses that are kept, and places of a search that are refined, in all and at one decision."""

RIVALS = 6
"""Places of a search, at least, that are refined because the plan is the other way round there than in the
likeliest one: how sure that one is depends on them."""

STRETCHED, ASPECTS = 24, (-0.07, 0.07)
"""Orientations and scales that are searched with the plan stretched too, and by which ratios' logarithms."""

LEAST_WALLS = 10
"""Points of walls from which a plan is looked for."""

APART = 1.5
"""Metres on average; hypotheses that are nearer to each other are one."""

SHIFTED, SHIFT_GROWTH = 3, 1.04
"""So many of the best hypotheses are laid onto the plan anew when the seen floor has grown by that factor."""

TRANSFORMED, FIRST_TRANSFORMED = 800_000, 50_000_000
"""Numbers that go through Fourier transforms at a decision, and at that of the first match, which asks for
all of them at once (some millions) unless the plan is kilometres long."""

NEW_ROUNDS, OLD_ROUNDS = (0.8, 0.5, 0.35, 0.35), (0.5, 0.35)
"""Metres at which walls lose their force, a round of refinement, of new places and of those that are kept."""

MOST_POINTS = 700
"""Points of walls, and of floor, that hypotheses are refined and judged by; more are thinned out evenly."""

MIRRORED_COST = 20.0
"""What a mirrored plan costs in log-likelihood: plans are hardly ever drawn so, and points that are seen say
much the same, so that their sum makes more of a difference than there is."""

SCALE_SLACK = 2.0
"""The spread of a scale counts as so many times as wide where places are compared, not where one is refined:
what is seen decides between them. The confidence was fitted to places that were compared so."""

HERE_STD = 3.0
"""Metres by which a place that is told ("you are here") is off."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A place of the plan, and how well it explains what is seen.

    Attributes:
        placed: Where, with its local stretching.
        slice: The orientation that it came from.
        fit: How well.
        bending: What its local stretching costs in log-likelihood.
        total: The fit's score with what is known before: scale, mirror, start.
    """

    placed: WarpedPlacement
    slice: Slice
    fit: Fit
    bending: float
    total: float

    @property
    def explained(self) -> float:
        """The total as if mirrored plans were as usual as others."""
        return self.total + MIRRORED_COST * self.slice.mirrored

    @property
    def world_scale(self) -> float:
        """World metres a plan metre, on average."""
        return float(np.exp(-self.placed.placement.parameters[:2].mean()))

    def distance_to(self, placed: WarpedPlacement, evidence: Evidence) -> float:
        """The greatest distance in world metres between this place and another, over what is seen."""
        points = _probes(evidence)
        apart = self.placed.to_plan(points) - placed.to_plan(points)
        return float(np.hypot(*apart.T).max()) * self.world_scale


class Registration:
    """Looks for the place of a plan in a map that grows.

    Args:
        prior: The plan.

    Attributes:
        hypotheses: The places that are kept, the best first.
        start: World point (x, y) of the robot's start, for a hint of where that lies in the plan; None while
            nobody has said it.
        evidence: What was seen at the last decision.
        steady_since: Square metres that had been seen when the best hypothesis last changed.
    """

    def __init__(self, prior: PriorPlan) -> None:
        self.prior, self.fields = prior, make_fields(prior)
        self._gains = make_gains(self.fields)
        self.hypotheses: list[Hypothesis] = []
        self.evidence = Evidence(np.zeros((0, 2)), np.zeros((0, 2)), 0.0)
        self.direction = 0.0
        self.start: tuple[float, float] | None = None
        self._searched = 0.0
        # Lists and no generator: what is under way can be copied and pickled.
        self._job: tuple[CoarseSearch, deque[Slice]] | None = None
        self._stretched = False
        self._found: list[Candidate] = []
        self._waiting: list[Candidate] = []
        self._shifted = 0.0
        self.steady_since = 0.0
        self._best: WarpedPlacement | None = None

    def update(self, grid: OccupancyGrid) -> None:
        """Bring the hypotheses up to what a grid shows."""
        if self.prior.unused:
            return
        self.evidence = seen_points(grid)
        if self.evidence.area < LEAST_AREA or len(self.evidence.walls) < LEAST_WALLS:
            return
        self._refresh()
        # One of the dear steps a decision; only the first match does all of them at once, if it can.
        if self._job is not None:
            self._search(TRANSFORMED)
        elif self._waiting:
            self._try(TRIED_A_DECISION)
        elif self.evidence.area >= GROWTH * self._searched:
            first = self._searched == 0
            self._begin_search(wall_direction(grid.free) + grid.origin.theta)
            self._search(FIRST_TRANSFORMED if first else TRANSFORMED)
            if first and self._job is None:
                self._try(TRIED)
        else:
            self._shift()
        self._note_best()

    def _begin_search(self, direction: float) -> None:
        """Look for the plan everywhere, by what has been seen, with walls in that direction (radians)."""
        self._searched, self.direction = self.evidence.area, direction
        search = CoarseSearch(self.fields, self._gains, self.evidence, self.direction)
        self._job, self._stretched = (search, deque(self._slices())), False

    def _note_best(self) -> None:
        """Since when the best hypothesis has said the same of a place."""
        if not self.hypotheses:
            return
        points = _probes(self.evidence)
        place = self.hypotheses[0].placed.to_plan(points)
        before = self._best
        if before is None or np.hypot(*(before.to_plan(points) - place).T).mean() > STEADY:
            self.steady_since = self.evidence.area
        self._best = self.hypotheses[0].placed

    def _shift(self) -> None:
        """Look for better positions of the best hypotheses, orientation and scale left as they are."""
        if self.evidence.area < SHIFT_GROWTH * self._shifted or not self.hypotheses:
            return
        self._shifted = self.evidence.area
        search = CoarseSearch(self.fields, self._gains, self.evidence, self.direction)
        found = []
        for hypothesis in self.hypotheses[:SHIFTED]:
            log_x, log_y = hypothesis.placed.placement.parameters[:2].tolist()
            part = dataclasses.replace(
                hypothesis.slice, log_scale=0.5 * (log_x + log_y), aspect=log_x - log_y
            )
            found += search.run(part)
        self._add(found)

    def _slices(self) -> Iterator[Slice]:
        """Orientations and scales to search, likeliest first; the best ones are then stretched, too."""
        reach = max(2.5 * self.prior.scale_spread, SCALE_STEP)
        steps = math.ceil(reach / SCALE_STEP)
        scales = np.arange(-steps, steps + 1, dtype=np.float64) * SCALE_STEP
        mirrored = (False, True) if self.prior.hints.mirror is None else (self.prior.hints.mirror,)
        rotation = self.prior.hints.rotation
        for part in slices(scales, (0, 1, 2, 3), mirrored):
            if rotation is not None:
                # Where the plan's y axis points in the building's axes; mirroring leaves it as it is.
                x, y = part.turn(self.fields.direction)[1]
                angle = self.direction + math.atan2(y, x) - math.pi / 2
                off = (angle - math.radians(rotation) + math.pi) % (2 * math.pi) - math.pi
                if abs(off) > math.pi / 4:
                    continue
            yield part

    def _aspects(self) -> Iterator[Slice]:
        """The best orientations and scales found so far, with the plan stretched along either axis."""
        best: dict[Slice, float] = {}
        for candidate in self._found:
            best[candidate.slice] = max(candidate.score, best.get(candidate.slice, -math.inf))
        for part in sorted(best, key=lambda part: -best[part])[:STRETCHED]:
            for aspect in ASPECTS:
                yield dataclasses.replace(part, aspect=aspect)

    def _search(self, budget: float) -> None:
        """Search on; when all is searched, the best places wait to be tried."""
        assert self._job is not None
        search, waiting = self._job
        while budget > 0:
            if not waiting and not self._stretched:
                waiting.extend(self._aspects())
                self._stretched = True
            if not waiting:
                self._job = None
                self._waiting, self._found = self._likeliest(self._found), []
                return
            part = waiting.popleft()
            budget -= search.cost(part)
            self._found += search.run(part)

    def _likeliest(self, found: list[Candidate]) -> list[Candidate]:
        """The places that are tried: the likeliest, among them some that are the other way round."""
        ranked = sorted(found, key=lambda c: -(c.score + self._expected(c.slice, c.placement)))
        rivals = [c for c in ranked if c.slice.mirrored != ranked[0].slice.mirrored][:RIVALS]
        first = ranked[: TRIED - len(rivals)]
        return first + [c for c in rivals if c not in first]

    def _try(self, count: int) -> None:
        """Refine some places that were found; the best ones, old and new, are kept."""
        tried, self._waiting = self._waiting[:count], self._waiting[count:]
        self._add(tried)

    def _add(self, found: Iterable[Candidate]) -> None:
        new = [self._refined(WarpedPlacement(c.placement), c.slice, NEW_ROUNDS) for c in found]
        self._keep([*self.hypotheses, *new])

    def _refresh(self) -> None:
        """Refine and judge the hypotheses by what is seen now."""
        if self.hypotheses:
            self._keep([self._better(h) for h in self.hypotheses])

    def _better(self, hypothesis: Hypothesis) -> Hypothesis:
        """A hypothesis after refinement, as it was where that does not help."""
        refined = self._refined(hypothesis.placed, hypothesis.slice, OLD_ROUNDS)
        before = self._judged(hypothesis.placed, hypothesis.slice, hypothesis.bending)
        return max(refined, before, key=lambda h: h.total)

    def _refined(self, placed: WarpedPlacement, part: Slice, scales: tuple[float, ...]) -> Hypothesis:
        """The best place near another, judged."""
        walls, floor = thinned(self.evidence.walls), thinned(self.evidence.floor)
        known = (self.direction, self.prior.scale_spread)
        begun = recentred(placed.placement, self.evidence.centre)
        shifts = placed.shifts(walls), placed.shifts(floor)
        linear = refine(begun, walls, floor, self.fields, known, scales, shifts)
        rounds = 1 if placed.lattice is not None else 2
        found, bending = bent(WarpedPlacement(linear, placed.lattice), walls, self.fields, rounds)
        return self._judged(found, part, bending)

    def _judged(self, placed: WarpedPlacement, part: Slice, bending: float) -> Hypothesis:
        walls, floor = thinned(self.evidence.walls), thinned(self.evidence.floor)
        scale = math.exp(-float(placed.placement.parameters[:2].mean()))
        fit = fit_points(placed.to_plan(walls), placed.to_plan(floor), self.fields, scale)
        # Points that were thinned out would say what their neighbours say.
        whole = max(len(self.evidence.walls), 1) / max(len(walls), 1)
        fit = fit._replace(score=fit.score * whole)
        total = fit.score + self._expected(part, placed.placement) - bending
        return Hypothesis(placed, part, fit, bending, total)

    def _expected(self, part: Slice, placement: Placement) -> float:
        """Log-probability of scale, mirror and start before anything is seen."""
        mean = 0.5 * (placement.parameters[0] + placement.parameters[1])
        cost = 0.5 * (mean / (SCALE_SLACK * self.prior.scale_spread)) ** 2 + MIRRORED_COST * part.mirrored
        here = self.prior.hints.here
        if here is not None and self.start is not None:
            matrix, shift = matrix_of(placement)
            off = np.hypot(*(matrix @ np.array(self.start) + shift - here))
            cost += 0.5 * float(off / HERE_STD) ** 2
        return -float(cost)

    def _keep(self, hypotheses: list[Hypothesis]) -> None:
        """The best ones that are apart, and the best one that is the other way round than the first."""
        points = _probes(self.evidence)
        kept: list[Hypothesis] = []
        places: list[Floats] = []
        ranked = sorted(hypotheses, key=lambda h: -h.total)
        for hypothesis in ranked:
            if len(kept) > 1 and hypothesis.total < kept[0].total - HOPELESS:
                break
            place = hypothesis.placed.to_plan(points)
            if all(np.hypot(*(place - other).T).mean() > APART for other in places):
                kept.append(hypothesis)
                places.append(place)
            if len(kept) == KEPT:
                break
        rival = next((h for h in ranked if h.slice.mirrored != kept[0].slice.mirrored), None)
        if rival is not None and rival not in kept:
            kept.append(rival)
        self.hypotheses = kept


def thinned(points: Floats) -> Floats:
    """At most `MOST_POINTS` of the points (n, 2), evenly."""
    step = -(-len(points) // MOST_POINTS)
    return points if step <= 1 else np.ascontiguousarray(points[::step])


def _probes(evidence: Evidence) -> Floats:
    """Corners of what is seen: where two places of the plan are compared."""
    points = np.concatenate([evidence.walls, evidence.floor])
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([low, high, (low[0], high[1]), (high[0], low[1]), (low + high) / 2])
