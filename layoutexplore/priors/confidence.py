"""How sure it is that a plan lies where the best hypothesis says: a calibrated probability.

A logistic model of few features of the registration. Its weights stand in `confidence.json`; they are fitted
to explorations of real floors, of plans that ship for training and of generated ones, with prior plans that
are true, rough, mirrored and of other buildings (`layoutexplore evaluate train-prior`). MODEL_CARD.md says on
which ones, and how right it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from layoutexplore.files import read_json
from layoutexplore.files.schema import Items, Number, TableOf
from layoutexplore.grids.arrays import Floats
from layoutexplore.priors.registration import Hypothesis, Registration

WEIGHTS = Path(__file__).parent / "confidence.json"

FEATURES = (
    "likelihood",
    "walls",
    "floor",
    "outside",
    "evidence",
    "margin",
    "margin_share",
    "mirror_margin",
    "mirror_share",
    "mirror_deficit",
    "bending",
    "mirrored",
    "scale",
    "aspect",
    "steadiness",
    "explained",
)
"""Names of the features, in their order."""

CLEAR, UNCLEAR = 150.0, 40.0
"""Log-likelihood by which a rival is worse, or a mirrored one better, at most: more says no more."""

_SCHEMA = TableOf(Items(Number()))


@dataclass(frozen=True, eq=False)
class ConfidenceModel:
    """A logistic model.

    Attributes:
        mean: float64 (features,), subtracted from the features.
        scale: float64 (features,), what they are divided by then.
        weights: float64 (features + 1,), the last one is the intercept.
    """

    mean: Floats
    scale: Floats
    weights: Floats

    def probability(self, features: Floats) -> Floats:
        """Probabilities float64 (n,) of rows of features float64 (n, features)."""
        scaled = np.clip((features - self.mean) / self.scale, -4.0, 4.0)
        score = scaled @ self.weights[:-1] + self.weights[-1]
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(score, -30.0, 30.0))))

    def as_table(self) -> dict[str, Any]:
        """What its file holds."""
        rows = zip(FEATURES, self.mean.tolist(), self.scale.tolist(), self.weights.tolist(), strict=False)
        table = {name: [round(v, 6) for v in values] for name, *values in rows}
        return {**table, "intercept": [round(float(self.weights[-1]), 6)]}


def model_of_table(table: dict[str, Any]) -> ConfidenceModel:
    """The model of a file's table."""
    rows = np.array([table[name] for name in FEATURES], np.float64)
    return ConfidenceModel(rows[:, 0], rows[:, 1], np.append(rows[:, 2], table["intercept"][0]))


@cache
def shipped_model() -> ConfidenceModel:
    """The model that ships."""
    return model_of_table(read_json(WEIGHTS, _SCHEMA))


def confidence(registration: Registration) -> float:
    """Probability 0..1 that the best hypothesis is right; 0 without any."""
    if not registration.hypotheses:
        return 0.0
    features = features_of(registration)[None]
    return float(shipped_model().probability(features)[0])


def features_of(registration: Registration) -> Floats:
    """float64 (features,): what tells whether the best hypothesis of a registration is right.

    Two rivals count: the best one in another place, and the best one the other way round, held for as usual.
    """
    best, fit = registration.hypotheses[0], registration.hypotheses[0].fit
    count = max(len(registration.evidence.walls), 1)
    margin, mirror_margin = _margins(registration.hypotheses)
    log_x, log_y = best.placed.placement.parameters[:2].tolist()
    likelihood = fit.score / count
    return np.array(
        [
            likelihood,
            fit.walls,
            fit.floor,
            fit.outside,
            math.log(count),
            math.log1p(margin),
            min(margin / count, 1.0),
            math.copysign(math.log1p(abs(mirror_margin)), mirror_margin),
            min(mirror_margin / count, 1.0),
            min(mirror_margin, 0.0),
            best.bending / count,
            float(best.slice.mirrored),
            abs(0.5 * (log_x + log_y)) / registration.prior.scale_spread,
            abs(log_x - log_y),
            math.log(max(registration.evidence.area / max(registration.steady_since, 1.0), 1.0)),
            fit.walls * math.log(count),
        ]
    )


def _margins(hypotheses: Sequence[Hypothesis]) -> tuple[float, float]:
    """By how much the first hypothesis is better than the best one the same way round, and the other way."""
    best = hypotheses[0]
    same = [h for h in hypotheses[1:] if h.slice.mirrored == best.slice.mirrored]
    turned = [h for h in hypotheses if h.slice.mirrored != best.slice.mirrored]
    margin = min(best.total - same[0].total, CLEAR) if same else CLEAR
    mirror = best.explained - max(h.explained for h in turned) if turned else CLEAR
    return max(margin, 0.0), min(max(mirror, -UNCLEAR), CLEAR)
