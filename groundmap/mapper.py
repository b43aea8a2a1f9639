"""The mapper: from views to a confidence grid, one page long."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.evidence.ground_plane.rasterised import drop_off_cells, evidence_of
from groundmap.evidence.ground_plane.ray_smoothing import smooth_features
from groundmap.evidence.ground_plane.surfaces import Surfaces, find_surfaces
from groundmap.evidence.ground_plane.visibility import SightFan, visible_freespace
from groundmap.evidence.triangulation import Mesh, triangulate
from groundmap.grid.fusion import RULES
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.frames import map_from_world
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View


@dataclass
class MapperStats:
    """What went in, over all views so far."""

    views: int = 0
    features_used: int = 0
    features_dropped: Counter[str] = field(default_factory=Counter)  #: by reason
    seen_through: int = 0  #: features behind a surface whose line of sight passes below its top
    through_viewpoint: int = 0  #: edges nearer than min_range


@dataclass(frozen=True)
class ViewParts:
    """One view taken apart, as `GroundMapper.explain` returns it."""

    ground_view: GroundView  #: features by height class
    mesh: Mesh  #: their triangulation
    surfaces: Surfaces
    fan: SightFan
    evidence: Evidence


class GroundMapper:
    """Fuses views into a 2-D confidence grid (paper, sections 3, 5.2 and 7).

    Parameters
    ----------
    stages : Stopwatch, optional
        Stopwatch to count the time of each step with, if it is to be shared.
    **settings
        `groundmap.settings.MapperSettings`: ``resolution`` [m/cell], ``fusion``, ``uncertainty``,
        ``max_range`` [m], ``step_height`` [m], ...

    Raises
    ------
    SettingsError
        An unknown setting (the nearest one is named), or a value out of range.

    Examples
    --------
    >>> from groundmap import StereoRig, View, fit_ground
    >>> from groundmap.view.frames import map_from_world
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> seen = [(320.0, 250.0, 450.0)]  # one ground feature, 5 m ahead and 1.5 m below
    >>> view = View.from_pixels(map_from_world(np.eye(4), "optical"), rig, points_px=seen)
    >>> mapper = GroundMapper(resolution=0.2)
    >>> for view in fit_ground([view], camera_height=1.5):
    ...     mapper.integrate(view)
    >>> mapper.grid.confidence_at([(3.0, 0.05), (6.0, 0.05)])
    array([-1.,  0.], dtype=float32)
    """

    def __init__(self, *, stages: Stopwatch | None = None, **settings: Any) -> None:
        self.settings = MapperSettings(**settings)
        parameters = {"cap": self.settings.cap} if self.settings.fusion == "capped" else {}
        self.grid = ConfidenceGrid(
            resolution=self.settings.resolution,
            frame=self.settings.frame,
            rule=RULES[self.settings.fusion](**parameters),
        )
        self.stats = MapperStats()
        self.stages = stages or Stopwatch()
        #: Cells of the grid that the last view changed, [row, col], shape (n, 2): what a planner
        #: that replans as the map grows has to look at.
        self.changed: Ints = np.empty((0, 2), dtype=np.int64)

    def integrate(self, view: View) -> None:
        """Add one view to the grid; a view that is refused leaves the grid as it was.

        `changed` then holds the cells that the view changed.

        Parameters
        ----------
        view : View
            With its ground plane, as `groundmap.fit_ground` yields it.

        Raises
        ------
        NoGroundPlaneError
            The view has no plane, or one that is not below its camera; the camera looks at the
            ground or the sky.
        """
        parts = self.explain(view)
        with self.stages.measure("fuse"):
            lower, z = parts.evidence.lower, parts.evidence.z
            drop_offs = drop_off_cells(parts.ground_view, self.grid)
            self.grid.fuse(lower, z)
            self.grid.add_drop_offs(drop_offs)
            self.changed = np.concatenate([np.argwhere(z) + lower, drop_offs])
            self.grid.trajectory = np.concatenate([self.grid.trajectory, _pose2d(view)])
        self.stats.views += 1
        self.stats.features_used += parts.ground_view.used
        self.stats.features_dropped.update(parts.ground_view.dropped)
        self.stats.seen_through += parts.fan.contradictions.features
        self.stats.through_viewpoint += parts.surfaces.through_viewpoint

    def explain(self, view: View) -> ViewParts:
        """Return what `integrate` would fuse, with every step on the way; changes nothing."""
        with self.stages.measure("heights"):
            ground_view = flatten(view, self.settings, number=self.stats.views)
            ground_view = smooth_features(ground_view, self.settings)
        with self.stages.measure("triangulate"):
            mesh = triangulate(ground_view.points, ground_view.segments)
        with self.stages.measure("surfaces"):
            surfaces = find_surfaces(ground_view, mesh, self.settings)
        with self.stages.measure("sight"):
            fan = visible_freespace(ground_view, surfaces, self.settings)
        with self.stages.measure("evidence"):
            evidence = evidence_of(ground_view, surfaces, fan, self.grid, self.settings)
        return ViewParts(ground_view, mesh, surfaces, fan, evidence)


def _pose2d(view: View) -> Floats:
    heading = view.T_map_base[:3, :3] @ view.rig.forward
    return np.array([[*view.T_map_base[:2, 3], np.arctan2(heading[1], heading[0])]])


def warm_up(settings: MapperSettings) -> None:
    """Compile (or load from the cache) all that `integrate` will need, on a view made up for it."""
    rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    ground, obstacle = (320.0, 250.0, 450.0), (420.0, 350.0, 240.0)
    view = View.from_pixels(
        map_from_world(np.eye(4), "optical"),
        rig,
        points_px=[ground, obstacle],
        segments_px=[[(250.0, 180.0, 240.0), (300.0, 230.0, 260.0)]],
    )
    mapper = GroundMapper(**settings.model_dump())
    mapper.integrate(view.with_plane(GroundPlane.below_camera(rig, 1.5)))
