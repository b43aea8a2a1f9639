"""The mapper, which turns views into a confidence grid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints, as_floats
from groundmap.errors import InputError
from groundmap.evidence.builders import BUILDERS
from groundmap.evidence.evidence import add_shadow
from groundmap.evidence.kept_views import KeptView, moved_views, unique_cells
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
    keep_views : bool, default False
        Keep a reference to each view and its evidence (about 0.2 MB), for `refuse`.
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

    def __init__(
        self, *, stages: Stopwatch | None = None, keep_views: bool = False, **settings: Any
    ) -> None:
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
        self._find_changed: Callable[[], Ints] = self._find_none
        self._kept: list[KeptView] | None = [] if keep_views else None

    @property
    def changed(self) -> Ints:
        """Cells ``[row, col]`` that the last view changed, shape (n, 2), for incremental planners.

        On a 3-D map ``[layer, row, col]``, shape (n, 3).
        """
        return self._find_changed()

    def _find_none(self) -> Ints:
        return np.empty((0, self.grid.ndim), dtype=np.int64)

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
            self._find_changed = evidence.cells
            recent = parts.recent_view(view.timestamp)
            if recent is not None:
                self.grid.recent_views.add(recent)
            self.grid.trajectory = np.concatenate([self.grid.trajectory, _pose2d(view)])
            self.grid.planes = np.concatenate([self.grid.planes, parts.planes])
        counts = parts.counts
        if self._kept is not None:
            self._kept.append(KeptView.of(view, parts.evidence, parts.planes))
        self.stats.views += 1
        self.stats.features_used += counts.used
        self.stats.features_dropped.update(counts.dropped)
        self.stats.seen_through += counts.seen_through
        self.stats.through_viewpoint += counts.through_viewpoint

    @property
    def recent(self) -> CellSet:
        """What is there now: the cells that the newest views saw as non-free, see `grid`."""
        return self.grid.recent

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
            The mapper does not keep views, there is not one pose for each, or its rule is
            'absolute'.
        CameraError
            A pose is not a rigid transform.
        NoGroundPlaneError
            With its new pose, a camera looks at the ground or the sky. The map is not changed.
        """
        if self.grid.rule.reads_shadow:
            # The shadow of a view depends on all views before it.
            expected = "a rule by which each view adds to the map on its own"
            hint = "Map the views anew."
            raise InputError("refuse", expected, repr(self.grid.rule.name), hint=hint)
        if self._kept is None:
            hint = "Give keep_views=True to the mapper."
            raise InputError("refuse", "a mapper that keeps its views", "another", hint=hint)
        new = as_floats("poses", poses, (len(self._kept), 4, 4))
        moved = moved_views(self._kept, new, tolerance, turn_tolerance)
        kept = list(self._kept)
        touched = [self._find_none()]
        for number in moved:
            view = replace(kept[number].view, T_map_base=new[number])
            parts = self.explain(view)
            again = KeptView.of(view, parts.evidence, parts.planes)
            touched += [kept[number].cells(), again.cells()]
            kept[number] = again
        changed = unique_cells(np.concatenate(touched))
        self._find_changed = lambda: changed
        with self.stages.measure("fuse"):
            self.grid.rebuild(changed, (one.evidence()[:3] for one in kept))
        self._kept = kept
        if moved:
            self.grid.trajectory = np.concatenate([_pose2d(one.view) for one in kept])
            self.grid.planes = np.concatenate([one.planes for one in kept])
            self._renew_recent_views([one.view for one in kept])
        return len(moved)

    def _renew_recent_views(self, views: list[View]) -> None:
        """Replace the newest views that the grid holds by the same views at their new poses."""
        held = self.grid.recent_views.held
        newest = views[len(views) - len(held) :]
        held.clear()
        for view in newest:
            self.grid.recent_views.add(self.explain(view).recent_view(view.timestamp))

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
