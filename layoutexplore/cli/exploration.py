"""What `layoutexplore explore` does with a run: pictures, a film, its state in a file, a summary."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from layoutexplore.benchmark.rows import Row
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.drawing.film import Film
    from layoutexplore.frontiers.decision import Agent
    from layoutexplore.grids.arrays import Bytes
    from layoutexplore.predictors.prior_plan import PriorPredictor
    from layoutexplore.simulation.simulation import Simulation

SAVED_EVERY = 1.0
"""Seconds between two states of a run in its file; a run that is ended in between goes on from the last."""


def notes_of(
    agent: str, chosen: Agent, simulation: Simulation, before: Mapping[str, Any] | None
) -> dict[str, str]:
    """What is kept with the state of a run; says so where a saved one had other code or weights.

    Args:
        agent: Name of the strategy.
        chosen: The strategy.
        simulation: Has the predictor that it asks for.
        before: What was kept with the run that goes on.
    """
    from layoutexplore.benchmark.rows import fingerprint_of_agent
    from layoutexplore.simulation.episode import untimed

    now = fingerprint_of_agent(agent, chosen, untimed(simulation.predictor))
    if before and before.get("fingerprint", now) != now:
        told = "its code, or what it has learnt from, has changed since the run was saved"
        typer.echo(f"{agent}: {told}: it goes on as it is now, from where it was then", err=True)
    return {"agent": agent} | ({"fingerprint": now} if now else {})


class RunWatcher:
    """Looks at a run at every decision.

    Args:
        line: Shows how far it is.
        notes: What is kept with the run's state: its agent, and what tells its code apart.
        pictures: Whether to keep a picture and the rooms believed of each quarter.
        state_file: Where the run's state is kept; nowhere when None.
        goes_on: Whether the run goes on from a saved one, which has seen the quarter it begins in.

    Attributes:
        pictures: PNG files by percent seen.
        layouts: Rooms believed, as GeoJSON, by percent seen.
        priors: PNG files of a plan known beforehand, over the map as it is believed to lie.
        goes_on: As given.
    """

    def __init__(
        self,
        line: ProgressLine,
        notes: dict[str, str],
        *,
        pictures: bool,
        state_file: Path | None,
        goes_on: bool = False,
    ) -> None:
        self._line, self._notes, self._draws, self._file = line, notes, pictures, state_file
        self._quarter = None if goes_on else -1
        self.goes_on = goes_on
        self._saved = 0.0
        self.pictures: dict[int, bytes] = {}
        self.layouts: dict[int, dict[str, Any]] = {}
        self.priors: dict[int, bytes] = {}
        self._asked = self._believed = 0

    def draw(self, state: Simulation) -> Bytes:
        """A picture of what is known."""
        from layoutexplore.drawing.pictures import draw_state

        return draw_state(state, agent=self._notes["agent"])

    def note(self, state: Simulation) -> None:
        """A decision is due, or the run is over."""
        share = min(1.0, state.coverage / state.config.coverage_goal)
        text = f"{state.distance:.0f} m, {state.decisions} decisions"
        self._line.advance(int(100 * state.coverage), 100, share, text)
        if not state.done:
            self._asked += 1
            self._believed += state.decision.foresee is not None
        before, self._quarter = self._quarter, 25 * int(4 * state.coverage)
        if self._draws and (state.done or (before is not None and self._quarter > before)):
            self._keep_picture(state, 100 if state.done else self._quarter)
        if self._file and time.monotonic() - self._saved >= SAVED_EVERY:
            self.save(state)

    def belief(self, state: Simulation) -> str:
        """Whether a plan known beforehand was believed; empty without one."""
        predictor = prior_of(state)
        if predictor is None:
            return ""
        if predictor.unused:
            return f"not used, because {predictor.unused}"
        if not self._believed:
            return (
                f"never believed (confidence {predictor.confidence:.2f} at the end): explored as without it"
            )
        share = f"{100 * self._believed / self._asked:.0f} % of {self._asked} decisions"
        return f"believed at {share}, confidence {predictor.confidence:.2f} at the end"

    def save(self, state: Simulation) -> None:
        """Write the state of the run, if there is a file for it."""
        from layoutexplore.simulation.saved_run import save_simulation

        if self._file:
            save_simulation(state, self._file, self._notes)
            self._saved = time.monotonic()

    def _keep_picture(self, state: Simulation, percent: int) -> None:
        from layoutexplore.drawing.prior_plans import draw_registered
        from layoutexplore.grids.ros_map import encode_png
        from layoutexplore.layout.export import layout_to_geojson

        self.pictures[percent] = encode_png(self.draw(state))
        predictor = prior_of(state)
        if predictor is not None and predictor.registration:
            drawn = draw_registered(
                state.mapper.grid, predictor.registration, predictor.confidence, state.track
            )
            self.priors[percent] = encode_png(drawn)
        if state.decision.rooms is not None:
            self.layouts[percent] = layout_to_geojson(state.decision.rooms.layout)


def prior_of(state: Simulation) -> PriorPredictor | None:
    """The predictor of a run that has a plan known beforehand; None where there is none."""
    from layoutexplore.predictors.prior_plan import PriorPredictor
    from layoutexplore.simulation.episode import untimed

    predictor = untimed(state.predictor)
    return predictor if isinstance(predictor, PriorPredictor) else None


def save_run(folder: Path, simulation: Simulation, watcher: RunWatcher) -> list[Path]:
    """Write map, track, curve, pictures and layouts (by percent seen) of a run; the files written.

    Unless the run goes on from a saved one, pictures and layouts of an earlier run in the folder that this
    one has not are deleted: they would pass for its own.
    """
    import io
    import json

    import numpy as np

    from layoutexplore.files import write_atomically
    from layoutexplore.files.run_folders import QUARTERLY, QUARTERLY_NAMES, RUN_MAP
    from layoutexplore.grids.ros_map import save_grid

    save_grid(simulation.mapper.grid, folder / RUN_MAP)
    tables = {
        "track": (simulation.track, "%.4f", "x,y,theta"),
        "curve": (simulation.curve, ["%.6f", "%.6f", "%d"], "distance,coverage,scan"),
    }
    for name, (table, digits, header) in tables.items():
        text = io.StringIO()
        np.savetxt(text, table, digits, ",", header=header, comments="")
        write_atomically(folder / f"{name}.csv", text.getvalue().encode())
    told = {percent: json.dumps(layout) + "\n" for percent, layout in watcher.layouts.items()}
    kinds: tuple[Mapping[int, bytes | str], ...] = (watcher.pictures, watcher.priors, told)
    made = {
        name.format(percent): content
        for name, contents in zip(QUARTERLY, kinds, strict=True)
        for percent, content in contents.items()
    }
    for name, content in made.items():
        write_atomically(folder / name, content)
    for name in () if watcher.goes_on else sorted(set(QUARTERLY_NAMES) - set(made)):
        (folder / name).unlink(missing_ok=True)
    return [folder / name for name in (RUN_MAP, "track.csv", "curve.csv", *made)]


def check_run_files(sources: list[str], folder: Path | None, state: Path | None) -> None:
    """See whether a run's files have their suffixes and are written over no plan that is read.

    Raises:
        ConfigError: They have not, or would be.
    """
    from layoutexplore.files import check_file, check_kept
    from layoutexplore.files.run_folders import QUARTERLY_NAMES, RUN_MAP
    from layoutexplore.maps.library import source_files

    kept = [file for source in sources for file in source_files(source)]
    if folder is not None:
        names = (RUN_MAP, "map.pgm", "track.csv", "curve.csv", *QUARTERLY_NAMES)
        check_kept([folder / name for name in names], kept)
    if state is not None:
        check_file(state, suffixes=(".npz",), option="--save-state", kept=kept)


def film_of(path: Path | None, fps: float) -> AbstractContextManager[Film | None]:
    """A film that is written to a path; nothing without one."""
    if path is None:
        return nullcontext()
    from layoutexplore.drawing.film import Film

    return Film(path, fps=fps)


def way_home(simulation: Simulation) -> str:
    """Send the robot back to its start; what became of it."""
    from layoutexplore.simulation.way_back import return_to_start

    metres, arrived = return_to_start(simulation)
    return f"{metres:.1f} m, {'arrived' if arrived else 'did not arrive'}"


def summary(row: Row, *, filmed: bool, back: str = "", prior: str = "") -> Table:
    """The table that is printed in the end.

    Args:
        row: The run.
        filmed: Whether a film was made meanwhile.
        back: What became of the way back, if there was one.
        prior: Whether a plan known beforehand was believed, if there was one.
    """
    from rich.table import Table

    from layoutexplore.simulation.stop_reasons import StopReason

    table = Table(box=None, show_header=False, pad_edge=False)
    reached = {"d90": row.reached90, "d95": row.reached95, "d99": row.reached99}
    # A saved run that was over has no decision left that could be timed.
    took = f", {row.ms_decision_median:.2f} ms each (median)" if row.ms_decision_median else ""
    missed = {n: "not measured" if math.isnan(getattr(row, n)) else "not reached" for n in reached}
    lines = [
        ("floor plan", f"{row.plan}, {row.target_area:.0f} m2 to see"),
        ("agent, sensor", f"{row.agent}, {row.sensor}"),
        (
            "ended by",
            f"{row.stop_reason}: {StopReason(row.stop_reason).sentence}"
            if row.stop_reason
            else "nothing: paused at a decision",
        ),
        ("seen", f"{100 * row.coverage:.1f} %, {row.rooms_finished} of {row.rooms} rooms finished"),
        ("travelled", f"{row.distance:.1f} m, {100 * row.revisits:.0f} % of it where it had been before"),
        *([("way back", back)] if back else ()),
        *(
            (f"{name[1:]} % seen after", f"{getattr(row, name):.1f} m" if ok else missed[name])
            for name, ok in reached.items()
        ),
        *([("prior plan", prior)] if prior else ()),
        ("decisions", f"{row.decisions}{took}"),
        ("scans", f"{row.scans}"),
        ("took", f"{row.wall_seconds:.1f} s{', filming included' if filmed else ''}"),
    ]
    for line in lines:
        table.add_row(*line)
    return table
