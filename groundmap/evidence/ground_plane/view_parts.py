"""The builder of 2-D maps: from a view to its evidence in the ground plane, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundmap.arrays import Floats
from groundmap.evidence.evidence import Counts, Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.evidence.ground_plane.rasterised import evidence_of
from groundmap.evidence.ground_plane.ray_smoothing import smooth_features
from groundmap.evidence.ground_plane.surfaces import Surfaces, find_surfaces
from groundmap.evidence.ground_plane.visibility import SightFan, visible_freespace
from groundmap.evidence.triangulation import Mesh, triangulate
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.view import View


@dataclass(frozen=True)
class ViewParts:
    """Intermediate results of the mapping of one view, in the order of the steps."""

    ground_view: GroundView  #: features by height class, in the ground plane
    mesh: Mesh  #: triangulation of the obstacle features
    surfaces: Surfaces  #: links, segments and single features that end lines of sight
    fan: SightFan  #: visible freespace by bearing
    evidence: Evidence  #: update of the grid's cells

    @property
    def planes(self) -> Floats:
        """Ground planes that the map keeps, shape (0, 6): a 2-D map is one already."""
        return np.empty((0, 6))

    @property
    def counts(self) -> Counts:
        """What became of the features."""
        return Counts(
            used=self.ground_view.used,
            dropped=self.ground_view.dropped,
            seen_through=self.fan.contradictions.features,
            through_viewpoint=self.surfaces.through_viewpoint,
        )


def build(
    view: View, grid: ConfidenceGrid, settings: MapperSettings, stages: Stopwatch, number: int
) -> ViewParts:
    """Return the evidence of one view for a 2-D map, with all intermediate results.

    Parameters
    ----------
    view : View
        With a ground plane.
    grid : ConfidenceGrid
        Resolution and origin of the cells.
    settings : MapperSettings
    stages : Stopwatch
    number : int
        Index of the view, for error messages.
    """
    with stages.measure("heights"):
        ground_view = flatten(view, settings, number=number)
        ground_view = smooth_features(ground_view, settings)
    with stages.measure("triangulate"):
        mesh = triangulate(ground_view.points, ground_view.segments)
    with stages.measure("surfaces"):
        surfaces = find_surfaces(ground_view, mesh, settings)
    with stages.measure("sight"):
        fan = visible_freespace(ground_view, surfaces, settings)
    with stages.measure("evidence"):
        evidence = evidence_of(ground_view, surfaces, fan, grid, settings)
    return ViewParts(ground_view, mesh, surfaces, fan, evidence)
