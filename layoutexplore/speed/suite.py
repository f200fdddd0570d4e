"""All measurements, in the order of the table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import cv2

from layoutexplore.errors import unknown_name
from layoutexplore.speed import decisions, environment, kernels, layout, training, vector
from layoutexplore.speed.measurement import Measurement, SpeedRow


def measurements(only: Sequence[str] = (), *, more: Sequence[Measurement] = ()) -> list[Measurement]:
    """The measurements of these names, all by default.

    Args:
        only: Names of measurements.
        more: Measurements of what lies above this folder.

    Raises:
        UnknownNameError: There is no measurement of that name.
    """
    known = {
        m.name: m
        for m in (
            Measurement("rays", kernels.ray_casting),
            Measurement("mapping", kernels.mapping),
            Measurement("noise", kernels.noisy_mapping),
            Measurement("frontiers", kernels.frontiers),
            Measurement("parts", kernels.parts),
            Measurement("geodesics", kernels.geodesics),
            Measurement("layout", layout.layouts),
            Measurement("steps", environment.frontier_steps),
            Measurement("decisions", decisions.decisions),
            Measurement("maps", environment.map_steps),
            Measurement("motion", environment.motion_steps),
            Measurement("vector", vector.vector_steps),
            Measurement("training", training.training),
            Measurement("reset", environment.resets),
            Measurement("memory", environment.memory),
            Measurement("import", environment.import_time),
            *more,
        )
    }
    for name in only:
        if name not in known:
            raise unknown_name("measurement", name, known)
    return [known[name] for name in only] or list(known.values())


def measure(
    only: Sequence[str] = (),
    *,
    more: Sequence[Measurement] = (),
    begin: Callable[[str], None] = lambda name: None,
) -> Iterator[SpeedRow]:
    """Run measurements one after the other, each on one thread.

    Args:
        only: Names of measurements; all by default.
        more: Measurements of what lies above this folder.
        begin: Called with the name of each measurement when it begins.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for measurement in measurements(only, more=more):
            begin(measurement.name)
            yield from measurement.run()
    finally:
        cv2.setNumThreads(threads)
