"""The content of a map of stella_vslam."""

from __future__ import annotations

from dataclasses import dataclass, field

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.io.readers.fields import Fields
from groundmap.sparse.cameras import Camera, Projection, equirectangular

PROJECTIONS: dict[str, Projection] = {
    "Perspective": "perspective",
    "RadialDivision": "perspective",
    "Fisheye": "fisheye",
    "Equirectangular": "equirectangular",
}
METRIC = {"Stereo", "RGBD"}


@dataclass
class StellaMap:
    """Cameras, landmarks and keyframes, as the file lists them."""

    cameras: dict[str, tuple[Camera, bool]] = field(default_factory=dict)  #: and whether metric
    landmark_ids: list[int] = field(default_factory=list)
    landmarks: list[Floats] = field(default_factory=list)
    keyframe_ids: list[int] = field(default_factory=list)
    timestamps: list[float] = field(default_factory=list)
    camera_names: list[str] = field(default_factory=list)
    poses: list[Floats] = field(default_factory=list)  #: camera to world
    seen: list[Ints] = field(default_factory=list)  #: ids of landmarks of each keyframe
    pixels: list[Floats] = field(default_factory=list)

    def add_keyframe(
        self,
        number: int,
        *,
        timestamp: float,
        camera: str,
        pose: Floats,
        seen: Ints,
        pixels: Floats,
    ) -> None:
        """Add a keyframe with its sightings.

        Parameters
        ----------
        number : int
            Its id.
        timestamp : float [s]
        camera : str
            Name of its camera.
        pose : ndarray, shape (4, 4)
            Camera to world.
        seen : ndarray of int, shape (k,)
            Ids of the landmarks.
        pixels : ndarray, shape (k, 2) [px]
        """
        self.keyframe_ids.append(number)
        self.timestamps.append(timestamp)
        self.camera_names.append(camera)
        self.poses.append(pose)
        self.seen.append(seen)
        self.pixels.append(pixels)


def camera_of(fields: Fields) -> tuple[Camera, bool]:
    """Return a camera, and whether it measures depth, so that the map is in metres.

    Raises
    ------
    FileFormatError
        A model that is not known.
    """
    model = fields.text("model_type")
    width, height = fields.index("cols", 0), fields.index("rows", 0)
    metric = fields.text("setup_type", "Monocular") in METRIC
    if model not in PROJECTIONS:
        expected = f"a camera model of {', '.join(PROJECTIONS)}"
        raise FileFormatError(fields.path, expected, repr(model))
    if model == "Equirectangular":
        return equirectangular(model, width, height), metric
    return (
        Camera(
            model=model,
            projection=PROJECTIONS[model],
            focal_px=fields.number("fx"),
            width=width,
            height=height,
            cx=fields.number("cx"),
        ),
        metric,
    )
