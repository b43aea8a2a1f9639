"""An ideal sensor without noise or missing features, as a reference for others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from pydantic import Field

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.settings import MapperSettings, Settings
from groundmap.simulate.drive import Drive
from groundmap.simulate.kernels.occlusion import first_hits
from groundmap.simulate.occlusion import edges_of
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.truth import in_images, seen_along_ground
from groundmap.simulate.world import World
from groundmap.view.frames import invert
from groundmap.view.view import Features, View

MOST = 5e6  # features of a view
SIGMA = 1e-6  # [m], standard deviation of every feature


class ScanSettings(Settings):
    """The density of the features of the ideal sensor."""

    bearing: float = Field(0.1, gt=0, description="step between features on obstacles [deg]")
    ground: float = Field(0.1, gt=0, description="step between features on the ground [m]")


def scan(
    world: World,
    moves: Drive,
    sensor: SensorSettings,
    settings: ScanSettings,
    mapper: MapperSettings,
) -> Iterator[View]:
    """Yield the views of an ideal sensor.

    Each view has a point on the nearest obstacle at every step of bearing, halfway between
    ``step_height`` and ``robot_height``, and points on a lattice on the visible ground.

    Parameters
    ----------
    world : World
    moves : Drive
    sensor : SensorSettings
        Field of view and range; the settings of the matcher are ignored.
    settings : ScanSettings
    mapper : MapperSettings
        Heights of obstacles: ``step_height`` and ``robot_height``.
    """
    heights = mapper.step_height, mapper.robot_height
    xmin, ymin, xmax, ymax = world.bounds
    _check_number((xmax - xmin) / settings.ground * (ymax - ymin) / settings.ground, "ground")
    _check_number(360.0 / settings.bearing, "bearing")
    lattice = np.stack(
        np.meshgrid(np.arange(xmin, xmax, settings.ground), np.arange(ymin, ymax, settings.ground)),
        axis=-1,
    ).reshape(-1, 2)
    holes = shapely.union_all([hole.outline for hole in world.holes])
    lattice = lattice[~shapely.intersects_xy(holes, lattice)]
    for pose, logged, time in zip(*moves, strict=True):
        T_map_camera = pose @ sensor.rig.T_base_camera
        obstacles = world.at(time).obstacles(*heights, opaque=True)
        walls = _walls(edges_of(obstacles), T_map_camera, sensor, settings)
        ground = lattice[seen_along_ground(obstacles, lattice, T_map_camera, sensor)]
        xyz = np.concatenate(
            [
                np.column_stack([walls, np.full(len(walls), sum(heights) / 2.0)]),
                np.column_stack([ground, np.zeros(len(ground))]),
            ]
        )
        T_camera_map = invert(T_map_camera)
        points = xyz @ T_camera_map[:3, :3].T + T_camera_map[:3, 3]
        covariance = np.tile(SIGMA**2 * np.eye(3), (len(points), 1, 1))
        yield View(
            T_map_base=logged,
            rig=sensor.rig,
            points=Features.points(points, covariance),
            timestamp=float(time),
        )


def _check_number(features: float, name: str) -> None:
    if features > MOST:
        raise InputError(
            f"scan.{name}",
            f"at most {MOST:g} features",
            f"{features:.3g}",
            hint="Give a larger step, or smaller bounds of the world [m].",
        )


def _walls(
    edges: Floats, T_map_camera: Floats, sensor: SensorSettings, settings: ScanSettings
) -> Floats:
    """Return the nearest point on an edge at each bearing, shape (n, 2) [m, map]."""
    forward = float(np.arctan2(T_map_camera[1, 2], T_map_camera[0, 2]))
    half = float(np.arctan2(sensor.width_px / 2.0, sensor.fx))
    step = np.radians(settings.bearing)
    bearings = forward + np.arange(-half, half + step, step)
    ranges = np.empty(len(bearings))
    first_hits(
        T_map_camera[:2, 3].copy(), bearings, edges, ranges, np.empty(len(bearings), dtype=np.int64)
    )
    hit = ranges <= sensor.max_range
    ray = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    places = T_map_camera[:2, 3] + ranges[hit, None] * ray[hit]
    inside: Floats = places[in_images(places, T_map_camera, sensor, sensor.max_range)]
    return inside
