"""`layoutexplore evaluate registration` and `train-prior`: how well prior plans find their place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import Sensors, asked_sensors, holding

if TYPE_CHECKING:
    from layoutexplore.evaluation.registration import RegistrationRow

KINDS = ("true", "rough", "corridors", "other-floor", "wrong", "mirrored")
"""Prior plans that are registered when none is named."""

UNPLACED = "other-floor"
"""Prior plans of which nobody knows where they lie: of these, none is right or wrong."""

NOTHING = (
    "No registration is judged: the floors are seen whole at the first look, or no such prior plan is known: "
    "--among tells where other floors and buildings are."
)
"""What is said instead of lines."""

Plans = Annotated[list[str], typer.Argument(help="Floor plans: names, splits, files or folders.")]
Folder = Annotated[Path, typer.Option(help="Folder for the rows; the same command goes on in it.")]
Kinds = Annotated[
    list[str] | None, typer.Option("--kind", "-k", help="Prior plan; all but empty when none is named.")
]
Among = Annotated[str, typer.Option(help="Where other floors and other buildings are found.")]
Jobs = Annotated[int, typer.Option(min=1, help="Worker processes.")]


def registration(
    plans: Plans, out: Folder, kind: Kinds = None, sensor: Sensors = None, among: Among = "", jobs: Jobs = 1
) -> None:
    """Prior plans of every kind, registered while floors are explored.

    Where foreseen doors are, how sure it is, and how right that is; a table in the folder, and on it goes
    where it was.
    """
    import numpy as np

    from layoutexplore.evaluation.partial_rooms_summary import calibration_error
    from layoutexplore.evaluation.registration import confidences, score_registrations
    from layoutexplore.files import write_atomically
    from layoutexplore.predictors.prior_plan import SURE

    found = _rows(plans, out, kind, sensor, among, jobs)
    rows = [row for row in found if row.coverage > 0]
    confidence = confidences(rows)
    lines = [
        f"{len({row.plan for row in rows})} floors of {len({row.building for row in rows})} buildings",
        "",
        "| plan | seen | explorations | right | door error [m] | confidence | believed | believed wrongly |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for s in score_registrations(rows, SURE):
        share = f"{s.right:.2f}"
        error = f"{s.error:.2f}" if s.error < 1e6 else "-"
        wrongly = f"{s.wrongly:.2f}"
        if s.kind == UNPLACED:
            share = error = wrongly = "-"
        lines.append(
            f"| {s.kind} | {s.coverage:.0%} | {s.floors} | {share} | {error} | {s.confidence:.2f} "
            f"| {s.believed:.2f} | {wrongly} |"
        )
    lines.append("" if rows else f"\n{NOTHING}")
    placed = np.array([row.kind != UNPLACED for row in rows], np.bool_)
    right = np.array([row.right for row in rows], np.bool_)[placed]
    if len(right):
        gap = calibration_error(confidence[placed], right)
        lines.append(f"Calibration error: {gap:.3f} over {len(right)} registrations.")
    if rows:
        last = {(row.plan, row.sensor, row.kind): row for row in rows}.values()
        times = np.median([[row.first_ms, row.median_ms, row.p95_ms] for row in last], axis=0)
        lines.append(
            f"Milliseconds of processor time, medians over explorations: first match {times[0]:.0f}, later "
            f"decisions {times[1]:.0f}, their 95th percentile {times[2]:.0f}."
        )
    text = "\n".join(lines) + "\n"
    write_atomically(out / "registration.md", text)
    typer.echo(text + f"\nwritten: {out / 'registration.md'}")


def train_prior(
    plans: Plans, out: Folder, kind: Kinds = None, sensor: Sensors = None, among: Among = "", jobs: Jobs = 1
) -> None:
    """Fit the confidence of registered prior plans to explorations; scores by leaving buildings out."""
    from itertools import compress

    import numpy as np

    from layoutexplore.evaluation.partial_rooms_summary import calibration_error
    from layoutexplore.evaluation.registration import moments_of, rows_until
    from layoutexplore.files import write_json
    from layoutexplore.training.priors.confidence import (
        LEARNT_UNTIL,
        example_weights,
        fit_confidence,
        held_out_confidence,
    )

    found = rows_until(_rows(plans, out, kind, sensor, among, jobs), LEARNT_UNTIL)
    learnt = [bool(row.features) and row.kind != UNPLACED for row in found]
    rows = list(compress(found, learnt))
    moments = list(compress(moments_of(found), learnt))
    features = np.array([row.features for row in rows])
    right = np.array([row.right for row in rows])
    weights = example_weights(moments, np.array([row.kind == "mirrored" for row in rows]))
    held_out = held_out_confidence(features, right, np.array([row.building for row in rows]), weights)
    judged = np.array([row.coverage > 0 for row in rows])
    error = calibration_error(held_out[judged], right[judged])
    missed = float(np.mean((held_out >= 0.5) != right))
    typer.echo(
        f"{len(rows)} registrations, {right.mean():.0%} of them right; held out by building: calibration "
        f"error {error:.3f}, {missed:.1%} on the wrong side of 0.5"
    )
    write_json(out / "confidence.json", fit_confidence(features, right, weights).as_table())
    typer.echo(f"written: {out / 'confidence.json'}")


def _rows(
    plans: Sequence[str],
    out: Path,
    kind: Sequence[str] | None,
    sensor: Sequence[str] | None,
    among: str,
    jobs: int,
) -> list[RegistrationRow]:
    """The rows of all floors and sensors, with a line of progress."""
    from functools import partial

    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.errors import unknown_name
    from layoutexplore.evaluation.registration import rows_of_source
    from layoutexplore.files import check_places
    from layoutexplore.maps.library import cached_plan, find_plans
    from layoutexplore.options import JOBS
    from layoutexplore.plugins.transport import worker_map
    from layoutexplore.priors.presets import PRESETS

    check_places(out)
    kinds = list(dict.fromkeys(kind or KINDS))
    for name in kinds:
        if name not in PRESETS:
            raise unknown_name("prior plan", name, PRESETS)
    sensors = asked_sensors(sensor)
    sources = find_plans(plans)
    for source in sources:
        cached_plan(source)  # one that cannot be read is told now, and not after hours
    tasks = [(source, name) for source in sources for name in sensors]
    jobs = min(JOBS.convert("--jobs", jobs), len(tasks))
    work = partial(rows_of_source, kinds=kinds, among=among, store=out)
    found: list[RegistrationRow] = []
    with holding(out), ProgressLine(plain_console(), "explorations") as line, worker_map(jobs) as spread:
        for k, rows in enumerate(spread(work, *zip(*tasks, strict=True))):
            found += rows
            line.advance(k + 1, len(tasks), (k + 1) / len(tasks), tasks[k][0])
    return found
