"""What a cell costs beyond its length: little clearance, little confidence, nothing known."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.arrays import Bools, Bytes, Floats, Floats32
from groundmap.settings import Settings

FREE_SPACE, MAX_NON_OBSTACLE = 0, 252  # Nav2's scale: in between, the dearer the higher
INSCRIBED_INFLATED_OBSTACLE, LETHAL_OBSTACLE, NO_INFORMATION = 253, 254, 255
DISTANCE_TOLERANCE = (
    1e-12  # relative error granted to distances that are cut to the inflation radius
)


class CostSettings(Settings):
    """What makes a metre dearer than a metre; with all weights at 0, the shortest route wins.

    A weight is in metres per metre: where it applies in full, a metre costs 1 + weight.
    """

    clearance_weight: float = Field(
        0.0, ge=0, le=1000, description="extra cost of a metre at the footprint's radius [m/m]"
    )
    inflation_radius: float = Field(
        1.5, ge=0, le=1000, description="clearance that costs nothing any more [m]"
    )
    cost_scaling_factor: float = Field(
        3.0, ge=0, le=1000, description="how fast that cost falls with clearance [1/m]"
    )
    confidence_weight: float = Field(
        0.0, ge=0, le=1000, description="extra cost of a metre of confidence 0 [m/m]"
    )
    unknown_weight: float = Field(
        3.0, ge=0, le=1000, description="extra cost of an unknown metre, if penalised [m/m]"
    )

    def top(self, *, penalise: bool) -> float:
        """Return the extra cost of the dearest metre there can be [m/m]."""
        dearest = self.confidence_weight
        if penalise:
            dearest = max(dearest, self.unknown_weight)
        return self.clearance_weight + dearest

    @property
    def reach(self) -> float:
        """Clearance beyond which nothing changes [m]."""
        return self.inflation_radius if self.clearance_weight > 0 else 0.0


def cell_costs(
    settings: CostSettings,
    clearance: Floats,
    confidence: Floats32,
    known: Bools,
    *,
    radius: float,
    penalise: bool,
) -> Bytes:
    """Return the costs of cells on which the footprint may stand, from 0 to 252.

    ``clearance_weight · exp(-cost_scaling_factor · (clearance - radius))``, for what is nearer
    than the inflation radius (Nav2's formula), plus ``confidence_weight · (1 + confidence)``, or
    ``unknown_weight`` where nothing certain is known; scaled so that the dearest metre there can
    be costs 252.

    Parameters
    ----------
    settings : CostSettings
    clearance : ndarray, shape (rows, cols) [m]
    confidence : ndarray of float32, shape (rows, cols)
    known : ndarray of bool, shape (rows, cols)
        Cells that are free; the others are unknown or contested.
    radius : float [m]
        Of the footprint.
    penalise : bool
        Whether what is not known costs `unknown_weight`.

    Examples
    --------
    >>> clearance, free = np.array([[0.5, 1.0, 2.0]]), np.array([[True, True, True]])
    >>> sure = np.full((1, 3), -1.0, dtype=np.float32)
    >>> near = CostSettings(clearance_weight=2.0)
    >>> cell_costs(near, clearance, sure, free, radius=0.5, penalise=False)
    array([[252,  56,   0]], dtype=uint8)
    """
    top = settings.top(penalise=penalise)
    if top == 0:
        return np.zeros(clearance.shape, dtype=np.uint8)
    near = np.exp(-settings.cost_scaling_factor * np.maximum(clearance - radius, 0.0))
    near[clearance >= settings.inflation_radius * (1.0 - DISTANCE_TOLERANCE)] = 0.0
    doubt = settings.confidence_weight * (1.0 + np.clip(confidence.astype(np.float64), -1.0, 0.0))
    if penalise:
        doubt[~known] = settings.unknown_weight
    extra = settings.clearance_weight * near + doubt
    costs: Bytes = np.rint(np.minimum(extra / top, 1.0) * MAX_NON_OBSTACLE).astype(np.uint8)
    return costs
