"""The tables of a model of COLMAP, and its camera models."""

from __future__ import annotations

from typing import NamedTuple

from groundmap.arrays import Floats, Ints

# Number of parameters by name, in the order of the numbers that binary files contain.
MODELS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": 4,
    "DIVISION": 5,
    "SIMPLE_FISHEYE": 3,
    "FISHEYE": 4,
}
# Models whose parameters begin with f, cx, cy; those of the others with fx, fy, cx, cy.
SINGLE_FOCAL = frozenset(
    {
        "SIMPLE_PINHOLE",
        "SIMPLE_RADIAL",
        "RADIAL",
        "SIMPLE_RADIAL_FISHEYE",
        "RADIAL_FISHEYE",
        "SIMPLE_DIVISION",
        "SIMPLE_FISHEYE",
    }
)


class Model(NamedTuple):
    """The content of the three files of a model."""

    camera_ids: Ints  #: shape (c,)
    cameras: list[tuple[str, int, int, Floats]]  #: name of the model, width, height, parameters
    image_ids: Ints  #: shape (n,)
    image_poses: Floats  #: shape (n, 7), qw qx qy qz tx ty tz, world to camera
    image_cameras: Ints  #: shape (n,), ids of cameras
    names: list[str]  #: of the n images
    keypoint_counts: Ints  #: shape (n,)
    keypoints: Floats  #: shape (k, 2) [px]
    keypoint_points: Ints  #: shape (k,), ids of points, or below 0
    point_ids: Ints  #: shape (m,)
    points: Floats  #: shape (m, 3) [world]
    track_counts: Ints  #: shape (m,)
    track_images: Ints  #: shape (t,), ids of images
