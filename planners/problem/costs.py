"""Extra costs of cells with little clearance, little confidence or without observations."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.arrays import Bools, Bytes, Floats, Floats32
from groundmap.settings import Settings

FREE_SPACE, MAX_NON_OBSTACLE = 0, 252  # Nav2's scale of traversable cells
INSCRIBED_INFLATED_OBSTACLE, LETHAL_OBSTACLE, NO_INFORMATION = 253, 254, 255
DISTANCE_TOLERANCE = 1e-12  # relative tolerance of distances cut to the inflation radius


class CostSettings(Settings):
    """Extra costs per metre; with all weights at 0, the shortest route is the best.

    A weight is in metres per metre: where it applies fully, a metre costs 1 + weight.
    """

    clearance_weight: float = Field(
        0.0, ge=0, le=1000, description="extra cost of a metre at the footprint's radius [m/m]"
    )
    inflation_radius: float = Field(
        1.5, ge=0, le=1000, description="clearance above which there is no extra cost [m]"
    )
    cost_scaling_factor: float = Field(
        3.0, ge=0, le=1000, description="decay rate of that cost with clearance [1/m]"
    )
    confidence_weight: float = Field(
        0.0, ge=0, le=1000, description="extra cost of a metre of confidence 0 [m/m]"
    )
    unknown_weight: float = Field(
        3.0, ge=0, le=1000, description="extra cost of an unknown metre, if penalised [m/m]"
    )

    def top(self, *, penalise: bool) -> float:
        """Return the highest possible extra cost of a metre [m/m]."""
        doubt = self.confidence_weight
        return self.clearance_weight + (max(doubt, self.unknown_weight) if penalise else doubt)

    @property
    def reach(self) -> float:
        """Clearance above which costs are constant [m]."""
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
    """Return the costs of traversable cells, from 0 to 252.

    The extra cost is ``clearance_weight · exp(-cost_scaling_factor · (clearance - radius))`` below
    the inflation radius (Nav2's formula), plus ``confidence_weight · (1 + confidence)``, or
    ``unknown_weight`` on unknown and contested cells. It is scaled so that the highest possible
    extra cost is 252.

    Parameters
    ----------
    settings : CostSettings
    clearance : ndarray, shape (rows, cols) [m]
    confidence : ndarray of float32, shape (rows, cols)
    known : ndarray of bool, shape (rows, cols)
        Cells that are free; the others are unknown or contested.
    radius : float [m]
        Radius of the footprint.
    penalise : bool
        Whether unknown and contested cells cost `unknown_weight`.

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
