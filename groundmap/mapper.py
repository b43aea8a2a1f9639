"""The mapper, which turns views into a confidence grid."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.evidence.builders import BUILDERS
from groundmap.evidence.evidence import Evidence, add_shadow
from groundmap.grid.cell_set import CellSet
from groundmap.grid.fusion import RULES
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.recent_views import RecentViews
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.frames import map_from_world
from groundmap.view.ground_fit import fit_ground
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


class GroundMapper:
    """Mapper that fuses views into a confidence grid, 2-D or 3-D (paper, sections 3, 5.2 and 7).

    Each view is evidence for free cells, which its lines of sight pass over, and for non-free
    cells, which its obstacle features are in. `integrate` adds the evidence of a view to `grid`.
    In 2-D (the default) features are triangulated in the ground plane, with ``mode="3d"`` in the
    image plane.

    Parameters
    ----------
    stages : Stopwatch, optional
        Stopwatch for the time of each step, if it is shared with other code.
    **settings
        Fields of `groundmap.MapperSettings`: ``mode``, ``resolution`` [m], ``fusion``,
        ``uncertainty``, ``max_range`` [m], ``step_height`` [m], ...

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
    recent : CellSet
        Cells that the newest views saw as non-free, for `planners.PlanningProblem`; none in 3-D.

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

    def __init__(self, *, stages: Stopwatch | None = None, **settings: Any) -> None:
        self.settings = MapperSettings(**settings)
        self._builder = BUILDERS[self.settings.mode]
        rule = RULES[self.settings.fusion]
        parameters = {part.name: getattr(self.settings, part.name) for part in fields(rule)}
        self.grid = ConfidenceGrid(
            resolution=self.settings.resolution,
            origin=(0.0,) * self._builder.ndim,
            frame=self.settings.frame,
            rule=rule(**parameters),
            heights=tuple(share * self.settings.step_height for share in SIGHT_STEPS),
        )
        self.grid.recent_views = RecentViews(
            views=self.settings.recent_views,
            seconds=self.settings.recent_seconds,
            spacing=self.settings.narrowest_footprint,
            depth=self.settings.recent_depth,
        )
        self.stats = MapperStats()
        self.stages = stages or Stopwatch()
        self._last: Evidence | None = None

    @property
    def changed(self) -> Ints:
        """Cells ``[row, col]`` that the last view changed, shape (n, 2), for incremental planners.

        On a 3-D map ``[layer, row, col]``, shape (n, 3).
        """
        if self._last is None:
            return np.empty((0, self.grid.ndim), dtype=np.int64)
        return self._last.cells()

    def integrate(self, view: View) -> None:
        """Add the evidence of one view to the grid; a refused view does not change the grid.

        Parameters
        ----------
        view : View
            With a ground plane, as from `groundmap.fit_ground`. A 3-D map needs none, but can be
            collapsed to 2-D only where views have one.

        Raises
        ------
        NoGroundPlaneError
            The view has no ground plane, or one that is not below its camera, or the camera looks
            at the ground or the sky (2-D maps only).
        InputError
            The view would need more cells than a map can have, or has no timestamp although
            `recent_seconds` is set.
        """
        self.grid.recent_views.check(view.timestamp)
        parts = self.explain(view)
        with self.stages.measure("fuse"):
            evidence = parts.evidence
            if self.grid.rule.reads_shadow:
                eye = (view.T_map_base @ view.rig.T_base_camera)[: self.grid.ndim, 3]
                evidence = add_shadow(evidence, self.grid, eye)
            self.grid.fuse(*evidence)
            self._last = evidence
            recent = parts.recent_view(view.timestamp)
            if recent is not None:
                self.grid.recent_views.add(recent)
            self.grid.trajectory = np.concatenate([self.grid.trajectory, _pose2d(view)])
            self.grid.planes = np.concatenate([self.grid.planes, parts.planes])
        counts = parts.counts
        self.stats.views += 1
        self.stats.features_used += counts.used
        self.stats.features_dropped.update(counts.dropped)
        self.stats.seen_through += counts.seen_through
        self.stats.through_viewpoint += counts.through_viewpoint

    @property
    def recent(self) -> CellSet:
        """What is there now: the cells that the newest views saw as non-free, see `grid`."""
        return self.grid.recent

    def explain(self, view: View) -> Any:
        """Return the evidence of one view with all intermediate results, without fusing it.

        Parameters
        ----------
        view : View
            With a ground plane, as from `groundmap.fit_ground`; a 3-D map needs none.

        Returns
        -------
        ViewParts or ImageParts
            Of `groundmap.evidence.ground_plane.view_parts` on a 2-D map, of
            `groundmap.evidence.image_plane.view_parts` on a 3-D map.
        """
        return self._builder.build(view, self.grid, self.settings, self.stages, self.stats.views)


def _pose2d(view: View) -> Floats:
    heading = view.T_map_base[:3, :3] @ view.rig.forward
    return np.array([[*view.T_map_base[:2, 3], np.arctan2(heading[1], heading[0])]])


def warm_up(settings: MapperSettings) -> None:
    """Compile the kernels of `fit_ground` and `GroundMapper`, or load them from the cache."""
    rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    ground, obstacle = (320.0, 250.0, 450.0), (420.0, 350.0, 240.0)
    view = View.from_pixels(
        map_from_world(np.eye(4), "optical"),
        rig,
        points_px=[ground, obstacle],
        segments_px=[[(250.0, 180.0, 240.0), (300.0, 230.0, 260.0)]],
    )
    mapper = GroundMapper(**settings.model_dump())
    for grounded in fit_ground([view], camera_height=1.5):
        mapper.integrate(grounded)
