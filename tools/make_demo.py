"""Make the log that `groundmap demo` maps: what a robot with a stereo camera saw of a courtyard.

The courtyard is made of boxes: walls, parked things, poles. Landmarks are strewn over their sides
and over the ground; a view has those in front of the camera that no box hides, as a stereo matcher
would give them: in pixels, noisy, some missing, some matched wrongly. The same seed makes the same
log; `python tools/make_demo.py` writes it to planners/demo_data, where the command finds it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap import StereoRig
from groundmap.arrays import Bools, Floats
from groundmap.frames import T_REP103_OPTICAL, invert, to_quaternion
from groundmap.io.columns import KINDS, LAYOUTS, Kind
from groundmap.io.rig import write_rig

FOLDER = Path(__file__).parent.parent / "planners" / "demo_data"
SEED = 20

WIDTH, HEIGHT = 640, 480  # [px], of both images
PITCH = np.radians(5.0)  # of the camera, downwards
CAMERA_HEIGHT = 1.0  # [m]
FARTHEST = 15.0  # [m], the matcher's range
MISSING, FALSE = 0.15, 0.02  # shares of the features in sight
FALSE_DISPARITY = (3.0, 80.0)  # [px], of wrong matches: 33 m to 1.25 m
PER_SIDE, PER_GROUND = 6.0, 6.0  # [1/m²], landmarks
LINES_PER_SIDE = 0.4  # [1/m²], segments of each direction, besides the edges of boxes
LONGEST = 1.2  # [m], of a segment
OUTSIDE = 0.01  # [m], landmarks stand off their box, so that it does not hide them
EVERY = 1.5, np.radians(36.0)  # [m], [rad]: the robot takes a view at least this often


class Box(NamedTuple):
    """Something that stands on the ground; metres."""

    x0: float
    y0: float
    x1: float
    y1: float
    height: float


DOOR = ((14.0, 9.0), (14.0, 10.4))  # [m, map], from jamb to jamb
WALLS = (
    Box(-0.2, -0.2, 24.2, 0.0, 2.5),  # south
    Box(-0.2, 16.0, 24.2, 16.2, 2.5),  # north
    Box(-0.2, 0.0, 0.0, 16.0, 2.5),  # west
    Box(24.0, 0.0, 24.2, 16.0, 2.5),  # east
    Box(13.9, 0.0, 14.1, 9.0, 2.5),  # between the two halves, up to the doorway
    Box(13.9, 10.4, 14.1, 16.0, 2.5),  # and on from it
)
PARKED = (
    Box(6.5, 4.6, 10.5, 6.4, 1.4),  # a car
    Box(3.2, 9.4, 4.8, 10.9, 0.9),  # crates
    Box(8.6, 12.2, 11.2, 13.8, 1.5),  # a container
    Box(1.4, 14.4, 3.4, 15.0, 0.5),  # a bench
    Box(17.4, 8.6, 20.4, 10.4, 1.2),  # a skip, behind the doorway
    Box(16.6, 1.4, 18.2, 5.2, 1.4),  # another car
    Box(20.6, 12.4, 22.2, 13.8, 0.7),  # crates
)
POLES = tuple(
    Box(x - 0.06, y - 0.06, x + 0.06, y + 0.06, 2.2)
    for x, y in ((7.0, 9.3), (12.2, 1.8), (3.6, 6.6), (20.8, 6.4), (17.0, 13.2))
)
BOXES = WALLS + PARKED + POLES
# Where the robot went, x, y [m] and yaw [deg]; it turns on the spot where only the yaw changes.
DRIVE = np.array(
    [
        (3.0, 3.4, 180), (3.0, 3.4, 270), (3.0, 3.4, 0), (6.0, 2.6, -15), (9.4, 2.8, -20),
        (11.4, 3.6, -10), (11.8, 5.4, 45), (12.0, 7.4, 110), (11.6, 8.2, 235), (8.0, 8.2, 190),
        (5.4, 8.0, 180), (2.2, 8.2, 190), (2.2, 8.2, 285), (2.2, 8.2, 180), (2.0, 9.6, 100),
        (2.0, 11.8, 80), (3.8, 12.6, 45), (5.8, 12.2, 40), (5.8, 12.2, -60), (6.8, 11.2, -10),
        (9.4, 10.8, 10), (12.2, 10.6, 70), (12.6, 9.7, 0), (15.4, 9.7, -10), (15.6, 9.2, -75),
        (15.4, 6.8, -75), (17.6, 6.8, 0), (20.0, 7.4, -20), (22.4, 6.0, -80), (21.6, 3.4, -110),
        (20.0, 2.6, 180), (20.0, 2.6, 90), (20.4, 4.8, 70), (22.4, 7.6, 80), (22.4, 10.6, 110),
        (22.4, 11.2, 180), (19.4, 11.6, 190), (16.2, 11.8, 150), (15.8, 12.0, 60),
    ]
)  # fmt: skip


class Landmarks(NamedTuple):
    """What can be matched in the courtyard."""

    points: Floats  # (n, 3) [m, map]
    segments: Floats  # (m, 2, 3) [m, map]


def rig() -> StereoRig:
    """Return the robot's stereo camera, 20 cm ahead of its middle."""
    mount = np.eye(4)
    mount[:3, :3] = [
        [np.cos(PITCH), 0.0, np.sin(PITCH)],
        [0.0, 1.0, 0.0],
        [-np.sin(PITCH), 0.0, np.cos(PITCH)],
    ]
    mount[:3, 3] = 0.2, 0.0, CAMERA_HEIGHT
    return StereoRig(
        fx=500.0, fy=500.0, cx=WIDTH / 2, cy=HEIGHT / 2, baseline=0.2,
        pixel_noise_px=0.5, T_base_camera=mount @ T_REP103_OPTICAL,
    )  # fmt: skip


def drive() -> Floats:
    """Return the poses of ``base_link`` along the drive, shape (n, 4, 4) [map]."""
    stops = np.column_stack([DRIVE[:, :2], np.unwrap(np.radians(DRIVE[:, 2]))])
    moves = np.diff(stops, axis=0)
    lengths = np.hypot(moves[:, 0], moves[:, 1]) / EVERY[0]
    counts = np.ceil(np.maximum(lengths, np.abs(moves[:, 2]) / EVERY[1])).astype(int)
    shares = [np.arange(count) / count for count in counts]
    steps = [stop + np.outer(t, move) for stop, t, move in zip(stops, shares, moves, strict=False)]
    x, y, yaw = np.concatenate([*steps, stops[-1:]]).T
    poses = np.tile(np.eye(4), (len(x), 1, 1))
    poses[:, 0, 0], poses[:, 0, 1] = np.cos(yaw), -np.sin(yaw)
    poses[:, 1, 0], poses[:, 1, 1] = np.sin(yaw), np.cos(yaw)
    poses[:, 0, 3], poses[:, 1, 3] = x, y
    return poses


def landmarks(rng: np.random.Generator) -> Landmarks:
    """Strew points and lines over the sides of the boxes, and points over the ground."""
    far = np.array([WALLS[0].x1, WALLS[1].y0, 0.0])
    points = [rng.uniform(0.0, far, (int(PER_GROUND * far[0] * far[1]), 3))]
    segments = []
    for x0, y0, x1, y1, height in BOXES:
        up = np.array([0.0, 0.0, height])
        corners = np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)])
        for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            side = following - corner
            along = OUTSIDE * side / np.linalg.norm(side)
            start = corner + np.array([along[1], -along[0], 0.0])
            spots = rng.uniform(size=(rng.poisson(PER_SIDE * area(side, up)), 2))
            points.append(start + spots @ [side, up])
            segments += [pieces(start + up, side), pieces(start - along, up)]  # the box's edges
            segments += [lines(rng, start, side, up), lines(rng, start, up, side)]
    return Landmarks(np.concatenate(points), np.concatenate(segments))


def area(side: Floats, up: Floats) -> float:
    """Return the area of a box's side."""
    return float(np.linalg.norm(side) * np.linalg.norm(up))


def pieces(start: Floats, way: Floats) -> Floats:
    """Cut an edge into segments of equal length."""
    count = int(np.ceil(np.linalg.norm(way) / LONGEST))
    cuts = start + np.outer(np.arange(count + 1) / count, way)
    return np.stack([cuts[:-1], cuts[1:]], axis=1)


def lines(rng: np.random.Generator, start: Floats, way: Floats, across: Floats) -> Floats:
    """Strew segments that run along `way` over a side of a box."""
    count = rng.poisson(LINES_PER_SIDE * area(way, across))
    length = rng.uniform(0.3, 1.0, count) * min(1.0, LONGEST / float(np.linalg.norm(way)))
    first = rng.random(count) * (1.0 - length)
    begin = start + np.outer(first, way) + np.outer(rng.random(count), across)
    return np.stack([begin, begin + np.outer(length, way)], axis=1)


def hidden(eye: Floats, targets: Floats) -> Bools:
    """Return which targets, shape (n, 3), have a box between them and the eye."""
    low = np.array([(box.x0, box.y0, -1.0) for box in BOXES])
    high = np.array([(box.x1, box.y1, box.height) for box in BOXES])
    ray = (targets - eye)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        slabs = np.stack([(low - eye) / ray, (high - eye) / ray])
    enters = np.maximum(slabs.min(axis=0).max(axis=2), 0.0)
    leaves = np.minimum(slabs.max(axis=0).min(axis=2), 1.0)
    blocked: Bools = np.logical_or.reduce(enters < leaves, axis=1)
    return blocked


def pixels(camera: StereoRig, T_map_base: Floats, places: Floats) -> tuple[Floats, Bools]:
    """Return (uL, uR, v) of places, shape (n, 3) [px], and which of them are in sight."""
    T_map_camera = T_map_base @ camera.T_base_camera
    T_camera_map = invert(T_map_camera)
    x, y, depth = (places @ T_camera_map[:3, :3].T + T_camera_map[:3, 3]).T
    ahead = (depth > 0.3) & (np.hypot(x, depth) < FARTHEST)
    depth = np.where(ahead, depth, 1.0)
    left = camera.cx + camera.fx * x / depth
    right = left - camera.fx * camera.baseline / depth
    down = camera.cy + camera.fy * y / depth
    inside = (right > 0) & (left < WIDTH) & (down > 0) & (down < HEIGHT)
    in_sight: Bools = ahead & inside & ~hidden(T_map_camera[:3, 3], places)
    return np.stack([left, right, down], axis=1), in_sight


def match(rng: np.random.Generator, seen: Floats, camera: StereoRig) -> tuple[Floats, Bools]:
    """Return features, shape (n, ends, 3) [px], as matched, and which of them are."""
    count = len(seen)
    matched = seen + rng.normal(scale=camera.pixel_noise_px, size=seen.shape)
    wrong = rng.random(count) < FALSE
    disparity = rng.uniform(*FALSE_DISPARITY, count)
    matched[wrong, :, 1] = matched[wrong, :, 0] - disparity[wrong, None]
    found: Bools = rng.random(count) >= MISSING
    return matched, found


def features(seed: int = SEED) -> dict[Kind, npt.NDArray[np.float32]]:
    """Return the rows of both tables, in pixels: view, id, and (uL, uR, v) of each end."""
    rng = np.random.default_rng(seed)
    camera, world = rig(), landmarks(rng)
    rows: dict[Kind, list[Floats]] = {"points": [], "segments": []}
    for view, T_map_base in enumerate(drive()):
        first_id = 0
        for kind in KINDS:
            places = getattr(world, kind)
            ends = 1 if kind == "points" else 2
            seen, in_sight = pixels(camera, T_map_base, places.reshape(-1, 3))
            ids = np.flatnonzero(in_sight.reshape(-1, ends).all(axis=1))
            matched, found = match(rng, seen.reshape(-1, ends, 3)[ids], camera)
            numbers = matched[found].reshape(-1, 3 * ends).round(2)
            heads = np.stack([np.full(len(numbers), view), ids[found] + first_id], axis=1)
            rows[kind].append(np.hstack([heads, numbers]))
            first_id = len(places)
    return {kind: np.concatenate(views).astype(np.float32) for kind, views in rows.items()}


def main() -> None:
    """Write the log in the format of `groundmap.io.folder`."""
    FOLDER.mkdir(exist_ok=True)
    write_rig(FOLDER / "rig.toml", rig(), "rep103")
    tables = features()
    arrays: dict[str, npt.NDArray[Any]] = {}
    for kind, rows in tables.items():
        arrays |= {kind: rows, f"{kind}_columns": np.array(LAYOUTS[kind][0].columns)}
    np.savez_compressed(FOLDER / "features.npz", allow_pickle=False, **arrays)
    with open(FOLDER / "poses.txt", "w", encoding="utf-8") as stream:
        stream.write("# timestamp tx ty tz qx qy qz qw\n")
        for timestamp, pose in enumerate(drive()):
            numbers = [float(timestamp), *pose[:3, 3], *to_quaternion(pose)]
            stream.write(" ".join(f"{number:.9g}" for number in numbers) + "\n")
    size = sum(path.stat().st_size for path in FOLDER.iterdir())
    counts = ", ".join(f"{len(rows)} {kind}" for kind, rows in tables.items())
    print(f"{FOLDER}: {len(drive())} views, {counts}, {size} bytes")


if __name__ == "__main__":
    main()
