"""What the report of a benchmark shows, from a results folder alone: tables, curves, pictures, sentences."""

from __future__ import annotations

import functools
import math
import platform
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from typing import Any, ClassVar

import layoutexplore
from layoutexplore.benchmark.analysis import (
    HEADLINE,
    METRICS,
    POOLED,
    Comparison,
    Curves,
    by_plan,
    cells_of_agents,
    compare,
    groups,
    headline_level,
    measured_levels,
    pooled_curves,
    ratios_by_plan,
    summarise_agents,
)
from layoutexplore.benchmark.manifest import agents_that_know, planned_runs
from layoutexplore.benchmark.rows import Row, column_meanings
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing import palette
from layoutexplore.report.agent_table import AgentLine, agent_table
from layoutexplore.report.caveats import caveats
from layoutexplore.report.layout_section import BeliefLine, LayoutSection, layout_section, prior_section
from layoutexplore.report.plots import (
    CurveLine,
    ForestPlot,
    Look,
    Picture,
    agent_looks,
    curve_lines,
    forest,
    heat,
    pictures_of_tracks,
)
from layoutexplore.report.profiles import ProfilePlot, profile_plot
from layoutexplore.report.replay import ReplayView, replay_view, runs_to_replay
from layoutexplore.report.templates import NBSP, number, percent

PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "shapely")


@dataclass(frozen=True)
class Group:
    """Everything about one sensor, or about all of them."""

    name: str
    forest: ForestPlot
    table: list[AgentLine]
    lines: list[CurveLine]


@dataclass(frozen=True)
class PlanLine:
    """One row of the table by floor plan: metres of each agent, and ratios to the baseline's."""

    plan: str
    sensor: str
    area: float
    metres: dict[str, float]
    ratios: dict[str, float]

    def shade(self, agent: str) -> str:
        """The background of an agent's metres, by their ratio to the baseline's."""
        return heat(self.ratios[agent])


@dataclass(frozen=True, eq=False, kw_only=True)
class BenchmarkView:
    """What the pages show of a benchmark, each thing worked out when it is first asked for.

    Attributes:
        folder: The results.
        rows: The runs that are shown.
        manifest: Of the results.
        baseline: The agent that all are compared with.
        comparisons: With it.
    """

    folder: ResultsFolder
    rows: Sequence[Row]
    manifest: dict[str, Any]
    baseline: str
    comparisons: Sequence[Comparison]

    metrics: ClassVar[Sequence[str]] = METRICS
    pooled: ClassVar[str] = POOLED
    ramp: ClassVar[Sequence[str]] = [palette.to_hex(palette.RAMP[end]) for end in (0, -1)]

    @classmethod
    def of(
        cls,
        folder: ResultsFolder,
        baseline: str | None = None,
        comparisons: Sequence[Comparison] | None = None,
    ) -> BenchmarkView:
        """All that a folder holds.

        Args:
            folder: What `layoutexplore benchmark` left.
            baseline: The agent to compare with; None for the one of the run.
            comparisons: Its comparisons, where they are known already.

        Raises:
            ResultsError: The folder holds no benchmark, or is damaged.
        """
        manifest = folder.manifest()
        rows = sorted(folder.rows(), key=lambda row: row.key)
        baseline = baseline or str(manifest["baseline"])
        comparisons = compare(rows, baseline) if comparisons is None else comparisons
        return cls(folder=folder, rows=rows, manifest=manifest, baseline=baseline, comparisons=comparisons)

    @property
    def settings(self) -> dict[str, Any]:
        """Of the benchmark."""
        found: dict[str, Any] = self.manifest["settings"]
        return found

    @cached_property
    def curves(self) -> Curves:
        """The curve of a run, read once."""
        return functools.cache(self.folder.curve)

    @cached_property
    def levels(self) -> tuple[str, ...]:
        """The levels of coverage that were measured."""
        return measured_levels(self.rows)

    @cached_property
    def level(self) -> str:
        """The level that agents are ranked at; empty where none was measured."""
        return headline_level(self.rows)

    @property
    def scale(self) -> str:
        """To where metres are counted: the highest level measured."""
        return f"to {self.levels[-1][1:]}{NBSP}%" if self.levels else "in all"

    @cached_property
    def knowing(self) -> Collection[str]:
        """The agents that are shown the floor plan."""
        return agents_that_know(self.manifest)

    @cached_property
    def tables(self) -> dict[str, list[AgentLine]]:
        """By group, first that of all sensors, a line an agent, the best first."""
        summaries = summarise_agents(self.rows, self.baseline, self.curves)
        return {
            name: agent_table(
                part,
                [c for c in self.comparisons if c.sensor == name],
                [s for s in summaries if s.sensor == name],
                self.levels,
                self.level,
                self.knowing,
            )
            for name, part in groups(self.rows).items()
        }

    @cached_property
    def order(self) -> list[str]:
        """The agents, the best first."""
        return [line.agent for line in next(iter(self.tables.values()), [])]

    @cached_property
    def looks(self) -> Mapping[str, Look]:
        """Colour and dashes of each agent."""
        return agent_looks(self.order, self.baseline)

    @cached_property
    def groups(self) -> list[Group]:
        """All sensors together, and each where there are several; empty where no run ended well."""
        shown = []
        for name, part in groups(self.rows).items():
            table = self.tables[name]
            curves = pooled_curves(part, self.baseline, self.curves)
            lines = curve_lines(curves, [line.agent for line in table], self.looks)
            mine = [c for c in self.comparisons if c.sensor == name]
            shown.append(Group(name, forest(mine, self.level), table, lines))
        return shown

    @property
    def candidates(self) -> list[Comparison]:
        """The comparisons that rank all agents but the baseline that do not know the plan."""
        lines = next(iter(self.tables.values()), [])
        return [
            line.main for line in lines if line.main and not line.privileged and line.agent != self.baseline
        ]

    @property
    def best(self) -> Comparison | None:
        """The best comparison of an agent that does not know the plan, at the level that ranks."""
        return min(self.candidates, key=lambda c: c.ratio.estimate, default=None)

    @property
    def verdict(self) -> str:
        """One honest sentence about the best agent; its subject is the agent."""
        return _verdict(self.best, self.baseline, same_cells=self.same_cells) if self.best else ""

    @cached_property
    def same_cells(self) -> bool:
        """Whether all agents ran the same cells."""
        return len({frozenset(cells) for cells in cells_of_agents(self.rows).values() if cells}) < 2

    @property
    def alone(self) -> str:
        """Why agents are compared with nobody, where they are."""
        return _why_alone(self.rows, self.baseline, self.level)

    @property
    def buildings(self) -> str:
        """How many buildings stand behind the intervals."""
        return _span(c.buildings for c in self.comparisons)

    @property
    def curve_cells(self) -> str:
        """How many cells stand behind the curves of coverage."""
        return _span(line.cells for group in self.groups[:1] for line in group.lines)

    @cached_property
    def plans(self) -> list[PlanLine]:
        """The table by floor plan."""
        return _plan_lines(self.rows, self.baseline, self.level) if self.level else []

    @cached_property
    def layouts(self) -> LayoutSection:
        """What layouts changed, how right they were, stopping early."""
        return layout_section(
            self.folder, self.rows, self.comparisons, self.baseline, self.curves, self.looks, self.knowing
        )

    @cached_property
    def beliefs(self) -> list[BeliefLine]:
        """What runs believed of plans known beforehand."""
        return prior_section(self.folder, self.rows, self.baseline, self.looks)

    @cached_property
    def replay(self) -> ReplayView | None:
        """The runs that can be played, those of decisive decisions first."""
        first = (picture.row for picture in self.layouts.decisive)
        return replay_view(self.folder, runs_to_replay(self.rows, first))

    @cached_property
    def profile(self) -> ProfilePlot | None:
        """How often agents are near the best."""
        return profile_plot(self.rows, self.looks, self.knowing) if self.level == HEADLINE else None

    @cached_property
    def pictures(self) -> list[tuple[str, list[Picture]]]:
        """The ways walked on some floor plans."""
        return pictures_of_tracks(self.folder, self.rows, self.baseline, self.knowing, self.level)

    @property
    def failed(self) -> list[Row]:
        """The runs that failed."""
        return [row for row in self.rows if row.error]

    @property
    def counts(self) -> dict[str, int]:
        """How many runs, floor plans, starts, sensors and agents there are."""
        names = {"floor plans": "plan", "starts": "start", "sensors": "sensor", "agents": "agent"}
        return {
            "runs": len(self.rows),
            **{label: len({getattr(row, name) for row in self.rows}) for label, name in names.items()},
        }

    @property
    def caveats(self) -> list[str]:
        """What these results do not say."""
        planned = planned_runs(self.manifest)
        return caveats(self.rows, self.settings, len(self.candidates), self.baseline, planned)

    @property
    def columns(self) -> list[tuple[str, str]]:
        """Name and meaning of the columns of results.csv."""
        return column_meanings()

    @property
    def versions(self) -> list[tuple[str, str]]:
        """Of this package and those that it stands on."""
        found = [("layoutexplore", layoutexplore.__version__), ("Python", platform.python_version())]
        installed = {name: next(iter(metadata.distributions(name=name)), None) for name in PACKAGES}
        found += [(name, package.version) for name, package in installed.items() if package]
        return [*found, ("system", f"{platform.system()} {platform.machine()}")]


def _verdict(best: Comparison, baseline: str, *, same_cells: bool) -> str:
    """One honest sentence about the best agent; its subject is the agent."""
    ratio = best.ratio
    known = math.isfinite(ratio.low)
    interval_text = f" (95{NBSP}% interval {number(ratio.low)}–{number(ratio.high)})" if known else ""
    share = f"{best.metric[1:]}{NBSP}% of a floor"
    needs = f"{number(ratio.estimate)} of the metres of {baseline} to see {share}{interval_text}"
    wins = best.improvement.estimate
    halves = " (as many count half)" if 0 < wins < 1 else ""  # else there are no ties
    better = f"It needs fewer than {baseline} in {percent(wins)} of {best.cells} paired runs{halves}." + (
        "" if same_cells else " Not all agents ran the same cells: see below."
    )
    if known and ratio.high < 1:
        return f"needs {needs}. {better}"
    if known and ratio.low > 1:
        return f"comes nearest to {baseline}, but is not as good: it needs {needs}. {better}"
    doubt = (
        "the interval does not leave out 1, so this may be chance"
        if known
        else "in one building, which proves nothing"
    )
    place = "comes out best" if ratio.estimate < 1 else f"comes nearest to {baseline}"
    return f"{place} with {needs}, but {doubt}. {better}"


def _why_alone(rows: Sequence[Row], baseline: str, level: str) -> str:
    """Why agents are compared with nobody, where they are."""
    mine = [row for row in rows if row.agent == baseline]
    if not mine:
        return f"The agent {baseline} did not run"
    if all(row.error for row in mine):
        return f"All runs of {baseline} failed"
    return f"{baseline} ran other cells" if level else f"Runs were ended below {METRICS[0][1:]}{NBSP}%"


def _span(numbers: Iterable[int]) -> str:
    """The least and the largest of some numbers, as text; empty without any."""
    found = sorted(set(numbers))
    return f"{found[0]} to {found[-1]}" if len(found) > 1 else "".join(map(str, found))


def _plan_lines(rows: Sequence[Row], baseline: str, level: str) -> list[PlanLine]:
    areas = {(row.plan, row.sensor): row.target_area for row in rows if not row.error}
    lines, paired = [], ratios_by_plan(rows, level, baseline)
    for key, metres in by_plan(rows, level).items():
        ratios = dict.fromkeys(metres, math.nan) | paired.get(key, {})
        lines.append(PlanLine(*key, areas[key], metres, ratios))
    return lines
