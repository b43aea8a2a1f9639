"""The builder of 3-D maps: from a view to its evidence in voxels, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundmap.arrays import Floats
from groundmap.evidence.evidence import Counts, Evidence
from groundmap.evidence.image_plane.patches import ImageMesh, Patches, patches_of
from groundmap.evidence.image_plane.vertices import (
    MERGED_PX,
    ImageFeatures,
    project,
    vertices_of,
)
from groundmap.evidence.image_plane.voxelised import evidence_of
from groundmap.evidence.triangulation import triangulate
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.camera_check import check_position
from groundmap.view.view import View


@dataclass(frozen=True)
class ImageParts:
    """Intermediate results of the mapping of one view, in the order of the steps."""

    features: ImageFeatures  #: features in the image
    image: ImageMesh  #: their triangulation, and the inverse depths of its vertices
    patches: Patches  #: planes over its triangles
    evidence: Evidence  #: update of the grid's voxels

    planes: Floats  #: shape (k, 6), the ground under the view, see `ConfidenceGrid.planes`; k <= 1

    @property
    def counts(self) -> Counts:
        """What became of the features."""
        return Counts(used=self.features.used, dropped=self.features.dropped)


def build(
    view: View, grid: ConfidenceGrid, settings: MapperSettings, stages: Stopwatch, number: int
) -> ImageParts:
    """Return the evidence of one view for a 3-D map, with all intermediate results.

    Parameters
    ----------
    view : View
        Its ground plane plays no part.
    grid : ConfidenceGrid
        Resolution and origin of the voxels.
    settings : MapperSettings
    stages : Stopwatch
    number : int
        Index of the view, for error messages.
    """
    check_position(view, number=number)
    with stages.measure("project"):
        features = project(view, settings)
    with stages.measure("triangulate"):
        mesh = triangulate(features.px, features.segments, merge_distance=MERGED_PX)
    with stages.measure("patches"):
        vertices = vertices_of(features, mesh, settings)
        image = ImageMesh(mesh, vertices, view.T_map_camera[:3, :3], features.focal)
        patches = patches_of(image, settings)
    with stages.measure("evidence"):
        evidence = evidence_of(image, patches, view, grid, settings)
    return ImageParts(features, image, patches, evidence, _ground(view))


def _ground(view: View) -> Floats:
    """Return the place on the ground below the base and the ground's normal, shape (k, 6) [map]."""
    if view.plane is None:
        return np.empty((0, 6))
    rotation, base = view.T_map_base[:3, :3], view.T_map_base[:3, 3]
    normal = rotation @ view.plane.normal
    return np.concatenate([base - view.plane.offset * normal, normal])[None]
