"""The mapper, which turns views into a confidence grid."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints, as_floats
from groundmap.errors import InputError
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.evidence.ground_plane.rasterised import evidence_of
from groundmap.evidence.ground_plane.ray_smoothing import smooth_features
from groundmap.evidence.ground_plane.surfaces import Surfaces, find_surfaces
from groundmap.evidence.ground_plane.visibility import SightFan, visible_freespace
from groundmap.evidence.kept_views import KeptView, moved_views, unique_cells
from groundmap.evidence.triangulation import Mesh, triangulate
from groundmap.grid.fusion import RULES
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.frames import map_from_world
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View

# Heights that evidence is kept apart by [step_height]. Below the lowest, sight touches the ground.
SIGHT_STEPS = (1 / 3, 1.0, 4.0)


@dataclass
class MapperStats:
    """Statistics over all integrated views."""

    views: int = 0  #: number of views
    features_used: int = 0  #: number of features that became evidence
    features_dropped: Counter[str] = field(default_factory=Counter)  #: number by reason
    seen_through: int = 0  #: features behind a surface, with a line of sight below its top
    through_viewpoint: int = 0  #: links and segments nearer than min_range


@dataclass(frozen=True)
class ViewParts:
    """Intermediate results of the mapping of one view, in the order of the steps."""

    ground_view: GroundView  #: features by height class, in the ground plane
    mesh: Mesh  #: triangulation of the obstacle features
    surfaces: Surfaces  #: links, segments and single features that end lines of sight
    fan: SightFan  #: visible freespace by bearing
    evidence: Evidence  #: update of the grid's cells


class GroundMapper:
    """Mapper that fuses views into a 2-D confidence grid (paper, sections 3, 5.2 and 7).

    Each view is evidence for free cells, which its lines of sight pass over, and for non-free
    cells, which its obstacle features are in. `integrate` adds the evidence of a view to `grid`.

    Parameters
    ----------
    stages : Stopwatch, optional
        Stopwatch for the time of each step, if it is shared with other code.
    keep_views : bool, default False
        Keep a reference to each view and its evidence (about 0.2 MB), for `refuse`.
    **settings
        Fields of `groundmap.MapperSettings`: ``resolution`` [m], ``fusion``, ``uncertainty``,
        ``max_range`` [m], ``step_height`` [m], ...

    Attributes
    ----------
    grid : ConfidenceGrid
        The map of all integrated views.
    settings : MapperSettings
    stats : MapperStats
        Numbers of views and of used and dropped features.
    stages : Stopwatch
    changed : ndarray, shape (n, 2)
        Cells ``[row, col]`` that the last view changed, for incremental planners.

    Raises
    ------
    SettingsError
        A setting is unknown (the nearest valid one is named) or out of range.

    Examples
    --------
    >>> from groundmap import StereoRig, View, fit_ground
    >>> from groundmap.view.frames import map_from_world
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> pixels = [(320.0, 250.0, 450.0)]  # one ground feature, 5 m ahead and 1.5 m below
    >>> view = View.from_pixels(map_from_world(np.eye(4), "optical"), rig, points_px=pixels)
    >>> mapper = GroundMapper(resolution=0.2)
    >>> for view in fit_ground([view], camera_height=1.5):
    ...     mapper.integrate(view)
    >>> mapper.grid.confidence_at([(3.0, 0.05), (6.0, 0.05)])
    array([-0.25,  0.  ], dtype=float32)
    """

    def __init__(
        self, *, stages: Stopwatch | None = None, keep_views: bool = False, **settings: Any
    ) -> None:
        self.settings = MapperSettings(**settings)
        parameters = {"cap": self.settings.cap} if self.settings.fusion == "capped" else {}
        self.grid = ConfidenceGrid(
            resolution=self.settings.resolution,
            frame=self.settings.frame,
            rule=RULES[self.settings.fusion](**parameters),
            heights=tuple(share * self.settings.step_height for share in SIGHT_STEPS),
        )
        self.stats = MapperStats()
        self.stages = stages or Stopwatch()
        self.changed: Ints = np.empty((0, 2), dtype=np.int64)
        self._kept: list[KeptView] | None = [] if keep_views else None

    def integrate(self, view: View) -> None:
        """Add the evidence of one view to the grid; a refused view does not change the grid.

        Parameters
        ----------
        view : View
            With a ground plane, as from `groundmap.fit_ground`.

        Raises
        ------
        NoGroundPlaneError
            The view has no ground plane, or one that is not below its camera, or the camera looks
            at the ground or the sky.
        InputError
            The view would need more cells than a map can have.
        """
        parts = self.explain(view)
        with self.stages.measure("fuse"):
            self.grid.fuse(*parts.evidence)
            self.changed = parts.evidence.cells()
            self.grid.trajectory = np.concatenate([self.grid.trajectory, _pose2d(view)])
        if self._kept is not None:
            self._kept.append(KeptView.of(view, parts.evidence))
        self.stats.views += 1
        self.stats.features_used += parts.ground_view.used
        self.stats.features_dropped.update(parts.ground_view.dropped)
        self.stats.seen_through += parts.fan.contradictions.features
        self.stats.through_viewpoint += parts.surfaces.through_viewpoint

    def refuse(
        self, poses: npt.ArrayLike, *, tolerance: float = 0.0, turn_tolerance: float = 0.0
    ) -> int:
        """Correct the poses of all views after the fact, as when a loop was closed.

        The map is the same as one of all views with the new poses. Only tiles that views with
        another pose touch, before or after, are built anew. `stats` are not changed.

        Parameters
        ----------
        poses : array_like, shape (n, 4, 4) [m, map]
            `View.T_map_base` of all integrated views, in their order.
        tolerance : float, default 0 [m]
            Views that moved by no more stay as they are mapped,
        turn_tolerance : float, default 0 [rad]
            if they turned by no more than this, too.

        Returns
        -------
        int
            Number of views with another pose.

        Raises
        ------
        InputError
            The mapper does not keep views, or there is not one pose for each.
        CameraError
            A pose is not a rigid transform.
        NoGroundPlaneError
            With its new pose, a camera looks at the ground or the sky. The map is not changed.
        """
        if self._kept is None:
            hint = "Give keep_views=True to the mapper."
            raise InputError("refuse", "a mapper that keeps its views", "another", hint=hint)
        new = as_floats("poses", poses, (len(self._kept), 4, 4))
        moved = moved_views(self._kept, new, tolerance, turn_tolerance)
        kept = list(self._kept)
        touched = [self.changed[:0]]
        for number in moved:
            view = replace(kept[number].view, T_map_base=new[number])
            again = KeptView.of(view, self.explain(view).evidence)
            touched += [kept[number].cells(), again.cells()]
            kept[number] = again
        self.changed = unique_cells(np.concatenate(touched))
        with self.stages.measure("fuse"):
            self.grid.rebuild(self.changed, (one.evidence() for one in kept))
        self._kept = kept
        if moved:
            self.grid.trajectory = np.concatenate([_pose2d(one.view) for one in kept])
        return len(moved)

    def explain(self, view: View) -> ViewParts:
        """Return the evidence of one view with all intermediate results, without fusing it.

        Parameters
        ----------
        view : View
            With a ground plane, as from `groundmap.fit_ground`.
        """
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
    """Compile the kernels of `GroundMapper.integrate`, or load them from the cache."""
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
