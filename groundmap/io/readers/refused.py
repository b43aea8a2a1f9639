"""Files of SLAM and SfM systems that cannot serve: what they lack, and where it is found."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import islice
from pathlib import Path

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file
from groundmap.io.readers.orbslam import TRAJECTORIES, kinds_in
from groundmap.io.readers.sniffing import head_of

WANTED = "poses, landmarks, and which view saw which"
IMAGES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"}
MOST_ENTRIES = 2000
ATLAS_HINT = "Save the trajectory and the points with their keyframes: see docs/sources/orbslam.md."


def refusal_of(path: Path) -> FileFormatError | None:
    """Return why a known file or folder cannot serve, or None if it is unknown.

    Parameters
    ----------
    path : Path
    """
    for check in CHECKS:
        found = check(path)
        if found is not None:
            got, hint = found
            return FileFormatError(path, WANTED, got, hint=hint)
    return None


Finding = tuple[str, str]  # what the file contains, and what to do


def _files(path: Path) -> list[Path]:
    """Return a file, or the first entries of a folder."""
    return [path] if path.is_file() else sorted(islice(path.iterdir(), MOST_ENTRIES))


def _document(path: Path) -> Finding | None:
    """Find documents of cameras without structure, by their first keys."""
    for file in _files(path):
        if file.suffix.lower() not in {".json", ".sfm", ".xml", ".abc", ".mg"}:
            continue
        head = head_of(file).decode("utf-8", "replace")
        if file.suffix.lower() == ".xml" and "<document" in head and "<chunk" in head:
            return (
                f"cameras of Metashape without points ({file.name})",
                "Export the tie points with the cameras: File > Export > Export Cameras > Bundler.",
            )
        if '"transform_matrix"' in head or ('"frames"' in head and '"camera_angle_x"' in head):
            return (
                f"poses of nerfstudio or NeRF without visibility ({file.name})",
                "Give the COLMAP folder from which it was made, such as colmap/sparse/0.",
            )
        if re.search(r'"transform_matrix"|"applied_transform"|"camera_angle_x"', head):
            return (
                f"poses of nerfstudio without visibility ({file.name})",
                "Give the COLMAP folder from which it was made, such as colmap/sparse/0.",
            )
    return None


def _archive(path: Path) -> Finding | None:
    """Find archives and databases of other stages."""
    for file in _files(path):
        head = head_of(file)
        if head.startswith(b"SQLite format 3\0") and b"two_view_geometries" in head + _more(file):
            return (
                f"features and matches of COLMAP, before the reconstruction ({file.name})",
                "Run 'colmap mapper', and give the folder sparse/0 that it writes.",
            )
        if b"serialization::archive" in head[:64] or file.suffix == ".osa":
            return (
                f"an atlas of ORB-SLAM3, which only the same build reads ({file.name})",
                ATLAS_HINT,
            )
        if head.startswith((b"VERTEX_SE3", b"EDGE_SE3", b"VERTEX_SE2", b"EDGE_SE2")):
            return (
                f"a pose graph without landmarks (g2o, {file.name})",
                "Give the map of the system that wrote it.",
            )
    return None


def _more(file: Path) -> bytes:
    """Return more of a database, where its tables are described."""
    try:
        with open_file(file) as stream:
            return stream.read(2**17)
    except (OSError, FileFormatError):
        return b""


def _text_tables(path: Path) -> Finding | None:
    """Find trajectories and points without visibility."""
    kinds = kinds_in(path)
    tracks = [file.name for kind in TRAJECTORIES for file in kinds.get(kind, [])]
    points = [file.name for file in kinds.get("points", [])]
    if path.is_file() and path.name not in tracks + points:
        return None
    if tracks:
        hint = "The landmarks, and which view saw which, are missing: give the map that the same "
        return f"a trajectory alone ({tracks[0]})", hint + "program saves, or see docs/sources."
    if points:
        got = f"points alone ({points[0]})"
        return got, "Put the trajectory of the cameras beside them, in TUM or KITTI form."
    return None


def _images(path: Path) -> Finding | None:
    """Find folders of images, of KITTI, EuRoC and others."""
    if path.is_file():
        if path.suffix.lower() in IMAGES:
            return "an image", "Give the map that a SLAM or SfM system made of the images."
        return None
    entries = _files(path)
    names = {entry.name for entry in entries}
    folders = {"image_0", "image_1", "image_2", "image_3", "image_00", "image_l", "mav0", "cam0"}
    inside = [entry for entry in entries if entry.suffix.lower() in IMAGES]
    if names & folders or inside or _holds_images(entries):
        kind = "EuRoC" if names & {"mav0", "cam0"} else "KITTI" if names & folders else ""
        what = f"images of {kind}" if kind else "images"
        return (
            f"{what} without features",
            "Run a SLAM or SfM system on them (COLMAP, ORB-SLAM, stella_vslam, RTAB-Map), and give "
            "its map; or write the matched features as a folder of views.",
        )
    return None


def _holds_images(entries: list[Path]) -> bool:
    """Return whether a folder in the folder begins with images."""
    for entry in entries:
        if entry.is_dir() and entry.name in {"images", "rgb", "left", "data"}:
            first = next(iter(sorted(islice(entry.iterdir(), 10))), None)
            if first is not None and first.suffix.lower() in IMAGES:
                return True
    return False


CHECKS: tuple[Callable[[Path], Finding | None], ...] = (
    _document,
    _archive,
    _images,
    _text_tables,
)
