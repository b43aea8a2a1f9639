"""Make the log that `groundmap demo` maps: a simulated drive of a stereo camera in a courtyard.

This file defines the courtyard, the drive and the rig; `groundmap.simulate` computes the views. The
same seed gives the same log. `python tools/make_demo.py` writes it to planners/demo_data, from
where the command reads it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from groundmap import StereoRig, View
from groundmap.arrays import Floats
from groundmap.io.columns import KINDS, LAYOUTS, Kind
from groundmap.io.folder import ARCHIVE, POSES, RIG
from groundmap.io.rig import write_rig
from groundmap.simulate import (
    Drive,
    DriveSettings,
    SensorSettings,
    Solid,
    World,
    drive,
    observe,
    sample_landmarks,
)
from groundmap.view.frames import to_quaternion
from groundmap.view.view import Features

FOLDER = Path(__file__).parent.parent / "planners" / "demo_data"
SEED = 20
DIGITS = 2  # of a pixel, after the point

DOOR = ((14.0, 9.0), (14.0, 10.4))  # [m, map], from jamb to jamb
# Opposite corners x0, y0, x1, y1 and the height of each obstacle in the courtyard [m, map].
WALLS = (
    (-0.2, -0.2, 24.2, 0.0, 2.5),  # south
    (-0.2, 16.0, 24.2, 16.2, 2.5),  # north
    (-0.2, 0.0, 0.0, 16.0, 2.5),  # west
    (24.0, 0.0, 24.2, 16.0, 2.5),  # east
    (13.9, 0.0, 14.1, 9.0, 2.5),  # between the two halves, up to the doorway
    (13.9, 10.4, 14.1, 16.0, 2.5),  # from the doorway on
)
PARKED = (
    (6.5, 4.6, 10.5, 6.4, 1.4),  # a car
    (3.2, 9.4, 4.8, 10.9, 0.9),  # crates
    (8.6, 12.2, 11.2, 13.8, 1.5),  # a container
    (1.4, 14.4, 3.4, 15.0, 0.5),  # a bench
    (17.4, 8.6, 20.4, 10.4, 1.2),  # a skip, behind the doorway
    (16.6, 1.4, 18.2, 5.2, 1.4),  # another car
    (20.6, 12.4, 22.2, 13.8, 0.7),  # crates
)
POLES = tuple(
    (x - 0.06, y - 0.06, x + 0.06, y + 0.06, 2.2)
    for x, y in ((7.0, 9.3), (12.2, 1.8), (3.6, 6.6), (20.8, 6.4), (17.0, 13.2))
)
COURTYARD = World(
    bounds=(0.0, 0.0, 24.0, 16.0),
    solids=tuple(
        Solid(shapely.box(*corners), top=height) for *corners, height in WALLS + PARKED + POLES
    ),
)
# Path of the robot; x, y [m] and yaw [deg].
DRIVE = DriveSettings(
    stops=(
        (3.0, 3.4, 180), (3.0, 3.4, 270), (3.0, 3.4, 0), (6.0, 2.6, -15), (9.4, 2.8, -20),
        (11.4, 3.6, -10), (11.8, 5.4, 45), (12.0, 7.4, 110), (11.6, 8.2, 235), (8.0, 8.2, 190),
        (5.4, 8.0, 180), (2.2, 8.2, 190), (2.2, 8.2, 285), (2.2, 8.2, 180), (2.0, 9.6, 100),
        (2.0, 11.8, 80), (3.8, 12.6, 45), (5.8, 12.2, 40), (5.8, 12.2, -60), (6.8, 11.2, -10),
        (9.4, 10.8, 10), (12.2, 10.6, 70), (12.6, 9.7, 0), (15.4, 9.7, -10), (15.6, 9.2, -75),
        (15.4, 6.8, -75), (17.6, 6.8, 0), (20.0, 7.4, -20), (22.4, 6.0, -80), (21.6, 3.4, -110),
        (20.0, 2.6, 180), (20.0, 2.6, 90), (20.4, 4.8, 70), (22.4, 7.6, 80), (22.4, 10.6, 110),
        (22.4, 11.2, 180), (19.4, 11.6, 190), (16.2, 11.8, 150), (15.8, 12.0, 60),
    ),
    every=1.5,
    every_turn=math.radians(36.0),
)  # fmt: skip
SENSOR = SensorSettings(
    fx=500.0,
    width_px=640,
    height_px=480,
    baseline=0.2,
    camera_height=1.0,
    camera_forward=0.2,
    pitch=math.radians(5.0),
    max_range=15.0,
    pixel_noise_px=0.5,
    missing=0.15,
    false_matches=0.02,
    false_disparity_px=(3.0, 80.0),  # 33 m to 1.25 m
)


def moves() -> Drive:
    """Return the drive; the logged poses have no noise."""
    return drive(DRIVE, np.random.default_rng(SEED))


def views() -> list[View]:
    """Return the views of the drive."""
    landmarks = sample_landmarks(COURTYARD, np.random.default_rng(SEED))
    return list(observe(COURTYARD, landmarks, moves(), SENSOR, seed=SEED))


def tables(log: Iterable[View]) -> dict[Kind, npt.NDArray[np.float32]]:
    """Return the rows of both tables: view, id, and (uL, uR, v) of each end, rounded [px].

    This is half as many columns as for XYZ and covariance, and the digits compress well.
    """
    rows: dict[Kind, list[Floats]] = {"points": [], "segments": []}
    for number, view in enumerate(log):
        for kind in KINDS:
            features: Features = getattr(view, kind)
            pixels = pixels_of(view.rig, features.xyz).reshape(len(features), -1)
            heads = np.stack([np.full(len(features), number), features.ids], axis=1)
            rows[kind].append(np.hstack([heads, pixels.round(DIGITS)]))
    return {kind: np.concatenate(parts).astype(np.float32) for kind, parts in rows.items()}


def pixels_of(rig: StereoRig, xyz: Floats) -> Floats:
    """Return the matched pixels (uL, uR, v) of points, shape (..., 3) [m, camera]."""
    x, y, depth = np.moveaxis(xyz, -1, 0)
    left = rig.cx + rig.fx * x / depth
    right = left - rig.fx * rig.baseline / depth
    return np.stack([left, right, rig.cy + rig.fy * y / depth], axis=-1)


def main() -> None:
    """Write the log in the format of `groundmap.io.folder`."""
    log = views()
    FOLDER.mkdir(exist_ok=True)
    write_rig(FOLDER / RIG, SENSOR.rig, "rep103")
    arrays: dict[str, npt.NDArray[Any]] = {}
    for kind, rows in tables(log).items():
        arrays |= {kind: rows, f"{kind}_columns": np.array(LAYOUTS[kind][0].columns)}
    np.savez_compressed(FOLDER / ARCHIVE, allow_pickle=False, **arrays)
    with open(FOLDER / POSES, "w", encoding="utf-8") as stream:
        stream.write("# timestamp tx ty tz qx qy qz qw\n")
        for view in log:
            numbers = [view.timestamp, *view.T_map_base[:3, 3], *to_quaternion(view.T_map_base)]
            stream.write(" ".join(f"{number:.9g}" for number in numbers) + "\n")
    size = sum(path.stat().st_size for path in FOLDER.iterdir())
    counts = ", ".join(f"{len(arrays[kind])} {kind}" for kind in KINDS)
    print(f"{FOLDER}: {len(log)} views, {counts}, {size} bytes")


if __name__ == "__main__":
    main()
