"""A response surface (Box and Wilson 1951): how a noisy value depends on parameters near the measured ones.

Every value is the sum of an offset that its group shares (a floor plan is long or short whatever the
parameters are) and of slope z + curvature z^2 per parameter. Offsets are taken out; slopes and curvatures are
taken to be small until the measurements say otherwise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from layoutexplore.grids.arrays import Floats

NOISE = 0.15
"""Standard deviation of one value around its group's offset: of logarithms of metres in small buildings."""

SLOPE = 0.03
"""Standard deviation of the slopes before anything is known, per unit of z."""

CURVATURE = 0.01
"""Standard deviation of the curvatures before anything is known."""

RELUCTANCE = 0.01
"""Curvature that is added around where one is: what hardly changes anything stays as it is."""


class ResponseSurface(NamedTuple):
    """Expected slopes and curvatures float64 (p,) at z = 0, and the standard deviations of the slopes."""

    slope: Floats
    curvature: Floats
    deviation: Floats


def fit_surface(z: Floats, values: Floats, *, noise: float = NOISE) -> ResponseSurface:
    """The surface behind some measurements.

    Args:
        z: float64 (groups, members, p), the parameters.
        values: float64 (groups, members).
        noise: Standard deviation of a value.

    Example:
        >>> z = np.random.default_rng(0).normal(size=(4000, 4, 1))
        >>> surface = fit_surface(z, 3.0 + 0.02 * z[..., 0] + 0.01 * z[..., 0] ** 2, noise=0.01)
        >>> surface.slope.round(3).tolist(), surface.curvature.round(3).tolist()
        ([0.02], [0.01])
    """
    count = z.shape[-1]
    terms = np.concatenate([z, z**2], axis=-1)
    terms = (terms - terms.mean(axis=1, keepdims=True)).reshape(-1, 2 * count)
    around = (values - values.mean(axis=1, keepdims=True)).reshape(-1)
    precision = np.diag(np.repeat([SLOPE**-2, CURVATURE**-2], count))
    covariance = np.linalg.inv(terms.T @ terms / noise**2 + precision)
    found = covariance @ (terms.T @ around / noise**2)
    return ResponseSurface(found[:count], found[count:], np.sqrt(np.diag(covariance)[:count]))


def lowest(surface: ResponseSurface, centre: Floats, trust: float, least: Floats) -> Floats:
    """Where to go on, float64 (p,): the lowest place of surface + RELUCTANCE (z - centre)^2 in a box.

    Args:
        surface: The surface.
        centre: float64 (p,), in the middle of the box that is searched.
        trust: Half the side of the box.
        least: float64 (p,), the least values that make sense.

    Example:
        >>> surface = ResponseSurface(np.array([-0.04, 0.02]), np.array([0.01, -0.02]), np.zeros(2))
        >>> lowest(surface, np.zeros(2), 1.5, np.full(2, -9.0)).tolist()
        [1.0, -1.5]
    """
    slope, curvature = surface.slope - 2 * RELUCTANCE * centre, surface.curvature + RELUCTANCE
    ends = np.stack([np.maximum(centre - trust, least), np.maximum(centre + trust, least)])
    downhill = np.argmin(slope * ends + curvature * ends**2, axis=0)
    lowest_end = np.take_along_axis(ends, downhill[None], axis=0)[0]
    bottom = np.divide(-slope, 2 * curvature, out=lowest_end.copy(), where=curvature > 0)
    chosen: Floats = np.clip(bottom, ends[0], ends[1])
    return chosen
