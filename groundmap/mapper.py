"""The mapper: from views to a confidence grid, one page long."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from groundmap.arrays import Floats
from groundmap.evidence import Evidence, drop_off_cells, evidence_of
from groundmap.features import View
from groundmap.fusion import RULES
from groundmap.grid import ConfidenceGrid
from groundmap.heights import FlatView, flatten
from groundmap.settings import MapperSettings
from groundmap.sight2d import SightFan, seen_through, visible_freespace
from groundmap.surfaces import Surfaces, find_surfaces
from groundmap.triangulation import Mesh, triangulate


@dataclass
class MapperStats:
    """What went in, over all views so far."""

    views: int = 0
    features_used: int = 0
    features_dropped: Counter[str] = field(default_factory=Counter)  #: by reason
    seen_through: int = 0  #: features behind a surface whose line of sight passes below its top
    through_viewpoint: int = 0  #: edges nearer than min_range
    stages_s: dict[str, float] = field(default_factory=dict)  #: seconds by stage

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time spent inside to a stage."""
        began = perf_counter()
        try:
            yield
        finally:
            self.stages_s[stage] = self.stages_s.get(stage, 0.0) + perf_counter() - began


@dataclass(frozen=True)
class ViewParts:
    """One view taken apart, as `GroundMapper.explain` returns it."""

    flat: FlatView  #: features by height class
    mesh: Mesh  #: their triangulation
    surfaces: Surfaces
    fan: SightFan
    evidence: Evidence


class GroundMapper:
    """Fuses views into a 2-D confidence grid (paper, sections 3, 5.2 and 7).

    Parameters
    ----------
    **settings
        `groundmap.settings.MapperSettings`: ``resolution`` [m/cell], ``fusion``, ``uncertainty``,
        ``max_range`` [m], ``step_height`` [m], ...

    Raises
    ------
    SettingsError
        An unknown setting (the nearest one is named), or a value out of range.

    Examples
    --------
    >>> import groundmap
    >>> rig = groundmap.StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> view = groundmap.View.from_pixels(
    ...     np.eye(4) [[2, 0, 1, 3]] * [[1], [-1], [-1], [1]], rig,
    ...     points_px=[(320.0, 250.0, 240.0 + 150.0)])
    >>> mapper = groundmap.GroundMapper(resolution=0.5)
    >>> for view in groundmap.fit_ground([view], camera_height=1.5):
    ...     mapper.integrate(view)
    >>> mapper.grid.confidence_at((3.0, 0.0))
    -1.0
    """

    def __init__(self, **settings: Any) -> None:
        self.settings = MapperSettings(**settings)
        parameters = {"cap": self.settings.cap} if self.settings.fusion == "capped" else {}
        self.grid = ConfidenceGrid(
            resolution=self.settings.resolution,
            frame=self.settings.frame,
            rule=RULES[self.settings.fusion](**parameters),
        )
        self.stats = MapperStats()

    def integrate(self, view: View) -> None:
        """Add one view to the grid; a view that is refused leaves the grid as it was.

        Parameters
        ----------
        view : View
            With its ground plane, as `groundmap.fit_ground` yields it.

        Raises
        ------
        NoGroundPlaneError
            The view has no plane, or its camera looks at the ground or the sky.
        """
        parts = self.explain(view)
        with self.stats.timed("fuse"):
            self.grid.fuse(parts.evidence.lower, parts.evidence.z)
            self.grid.add_drop_offs(drop_off_cells(parts.flat, self.grid))
            self.grid.trajectory = np.concatenate([self.grid.trajectory, _pose2d(view, parts.flat)])
        self.stats.views += 1
        self.stats.features_used += parts.flat.used
        self.stats.features_dropped.update(parts.flat.dropped)
        self.stats.seen_through += seen_through(parts.flat, parts.fan, parts.surfaces)
        self.stats.through_viewpoint += parts.surfaces.through_viewpoint

    def explain(self, view: View) -> ViewParts:
        """Return what `integrate` would fuse, with every step on the way; changes nothing."""
        with self.stats.timed("heights"):
            flat = flatten(view, self.settings)
        with self.stats.timed("triangulate"):
            mesh = triangulate(flat.points, flat.segments)
        with self.stats.timed("surfaces"):
            surfaces = find_surfaces(flat, mesh, self.settings)
        with self.stats.timed("sight"):
            fan = visible_freespace(flat, surfaces, self.settings)
        with self.stats.timed("evidence"):
            evidence = evidence_of(flat, surfaces, fan, self.grid, self.settings)
        return ViewParts(flat, mesh, surfaces, fan, evidence)


def _pose2d(view: View, flat: FlatView) -> Floats:
    yaw = np.arctan2(flat.forward[1], flat.forward[0])
    return np.array([[*view.T_map_base[:2, 3], yaw]])
