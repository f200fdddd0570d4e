"""A response surface (Box and Wilson 1951): how a noisy value depends on a few parameters near where it was measured.

Every value is the sum of an offset that its group shares (a floor plan is long or short whatever the parameters are) and of
slope z + curvature z^2 per parameter. Offsets are taken out; slopes and curvatures have a prior, so that what the noise hides
stays near "no slope, a shallow bowl".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NOISE = 0.15
"""Standard deviation of one value around its group's offset: logarithms of metres of explorations of small buildings."""

SLOPE = 0.03
"""Standard deviation of the slopes before anything is known, per unit of z."""

CURVATURE = 0.01, 0.01
"""Mean and standard deviation of the curvatures before anything is known."""

_SHALLOW = 1e-4


class Surface(NamedTuple):
    """Expected slopes and curvatures float64 (p,) at z = 0, and the standard deviations of the slopes."""

    slope: NDArray[np.float64]
    curvature: NDArray[np.float64]
    deviation: NDArray[np.float64]


def fit_surface(z: NDArray[np.float64], values: NDArray[np.float64], *, noise: float = NOISE) -> Surface:
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
    mean = np.repeat([0.0, CURVATURE[0]], count)
    precision = np.diag(np.repeat([SLOPE**-2, CURVATURE[1] ** -2], count))
    covariance = np.linalg.inv(terms.T @ terms / noise**2 + precision)
    found = covariance @ (terms.T @ around / noise**2 + precision @ mean)
    return Surface(found[:count], found[count:], np.sqrt(np.diag(covariance)[:count]))


def lowest(surface: Surface, centre: NDArray[np.float64], trust: float, least: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a surface is lowest, float64 (p,).

    Args:
        surface: The surface.
        centre: float64 (p,), in the middle of the box that is searched.
        trust: Half the side of the box.
        least: float64 (p,), the least values that make sense.

    Example:
        >>> surface = Surface(np.array([-0.02, 0.02]), np.array([0.01, -0.01]), np.zeros(2))
        >>> lowest(surface, np.zeros(2), 1.5, np.full(2, -9.0)).tolist()
        [1.0, -1.5]
    """
    low = np.maximum(centre - trust, least)
    high = np.maximum(centre + trust, least)
    bowl = surface.curvature > _SHALLOW
    bottom = np.divide(-surface.slope, 2 * surface.curvature, out=np.zeros_like(low), where=bowl)
    ends = np.stack([low, high])
    downhill = np.argmin(surface.slope * ends + surface.curvature * ends**2, axis=0)
    return np.where(bowl, np.clip(bottom, low, high), np.take_along_axis(ends, downhill[None], axis=0)[0])
