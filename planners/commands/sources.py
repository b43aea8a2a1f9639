"""Sources of views for commands: opened, scaled and levelled as the options say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from groundmap import View, read_views
from groundmap.arrays import Floats
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.io.alignment import AlignedViews, ScalePoints, align, is_metric
from groundmap.io.log import ViewLog
from groundmap.io.readers.base import SparseMapLog

EXAMPLE_HEIGHT = 1.4  # [m], of a camera, in the sentence that explains --scale
MOST_TILT = np.radians(5.0)  # of the ground of a log that is not levelled
LOW, HIGH = 0.05, 0.95  # quantiles of the heights of the cameras

SourceArgument = Annotated[
    Path,
    typer.Argument(help="Folder with a log of views, or the map of a SLAM or SfM system."),
]
FormatOption = Annotated[
    str | None,
    typer.Option(help="Format of the source; default: detected from the contents of its files."),
]
PosesOption = Annotated[
    Path | None,
    typer.Option(help="File with poses to use instead: TUM rows, or id + 16 numbers."),
]
PosesOrModeOption = Annotated[
    Path | None,
    typer.Option(
        help="File with poses to use instead: TUM rows, or id + 16 numbers; or `estimate` to "
        "determine them from the features alone, `refine` to start from the given ones."
    ),
]
ScaleOption = Annotated[
    float | None, typer.Option(help="Metres per unit of a sparse map, which has none of its own.")
]
ScalePointsOption = Annotated[
    tuple[str, str, float] | None,
    typer.Option(
        help="Two places of a sparse map (id of a landmark, name of a view, or X,Y,Z) and their "
        "distance [m], which give its scale.",
        metavar="A B D",
    ),
]
CameraHeightOption = Annotated[
    float | None,
    typer.Option(
        help="Height of the camera above the ground [m]: gives the scale of a sparse map without "
        "a unit; otherwise level ground is assumed this far below the camera."
    ),
]
LevelOption = Annotated[
    bool | None,
    typer.Option(
        help="Turn the world so that the ground is level; default: for sparse maps whose "
        "direction up is unknown."
    ),
]
PointNoiseOption = Annotated[
    float | None,
    typer.Option(help="Standard deviation of the landmarks of a sparse map [its unit]."),
]
GuessOption = Annotated[
    bool,
    typer.Option(
        "--guess-visibility",
        help="Guess which view saw which landmark, where the files do not contain it.",
    ),
]


@dataclass
class Source:
    """A log of views as a command maps it."""

    views: AlignedViews
    metric: bool  #: whether its unit is known, or was given
    camera_height: float | None  #: for `groundmap.fit_ground` [m]
    heights: list[float] = field(default_factory=list)  #: of the cameras above the ground
    normals: list[Floats] = field(default_factory=list)  #: of the ground [map]

    @property
    def log(self) -> ViewLog:
        """The log itself."""
        return self.views.log

    def watch(self, views: Iterable[View]) -> Iterator[View]:
        """Yield views with ground planes, and keep the heights and the normals of these."""
        views = iter(views)
        while True:
            try:
                view = next(views)
            except StopIteration:
                return
            except NoGroundPlaneError as error:
                raise NoGroundPlaneError(f"{error}{self._unit_hint()}") from None
            if view.plane is not None:
                self.heights.append(float(view.plane.height(view.rig.T_base_camera[:3, 3])))
                self.normals.append(view.T_map_base[:3, :3] @ view.plane.normal)
            yield view

    def _unit_hint(self) -> str:
        ground = self.views.ground
        if self.metric or ground is None:
            return ""
        return (
            f" The source has no unit; its ground is about {ground.camera_height:.3g} units below "
            "the cameras. Give --camera-height or --scale."
        )

    def summary(self) -> dict[str, Any]:
        """Return what the source contains, and how it was scaled and levelled, as JSON values."""
        similarity = self.views.similarity
        values: dict[str, Any] = {
            "scale": similarity.scale,
            "metric": self.metric,
            "levelled_degrees": float(np.degrees(similarity.tilt)),
            "camera_height": self._heights(),
        }
        if isinstance(self.log, SparseMapLog):
            values["source"] = describe_map(self.log)
        return values

    def _heights(self) -> dict[str, float] | None:
        if not self.heights:
            return None
        low, median, high = np.quantile(self.heights, [LOW, 0.5, HIGH]).tolist()
        return {"median": median, "low": low, "high": high}

    def sentences(self) -> list[str]:
        """Return sentences about what was read, the height of the camera, and the unit."""
        found = []
        if isinstance(self.log, SparseMapLog):
            found = [describe_sentence(self.log), *self.log.sparse.notes]
        heights = self._heights()
        if heights is not None and self.camera_height is None:
            unit = " m" if self.metric else ""
            sentence = (
                f"ground {heights['median']:.2f}{unit} below the camera, "
                f"{heights['low']:.2f} to {heights['high']:.2f}"
            )
            if not self.metric:
                factor = EXAMPLE_HEIGHT / heights["median"]
                sentence += f"; if it is {EXAMPLE_HEIGHT} m: --scale {factor:.3g}"
            found.append(sentence)
        return found

    def warnings(self) -> list[str]:
        """Return warnings about an unknown unit, and about ground that is not level."""
        found = []
        if not self.metric:
            found.append(
                "the unit of the source is unknown, and was taken for a metre: give --scale, "
                "--scale-points or --camera-height"
            )
        if self.views.levelled and self.views.ground is None:
            found.append(
                "no ground was found under the track: the world was levelled by the mean attitude "
                "of the cameras"
            )
        if self.normals and not self.views.levelled:
            mean = np.mean(self.normals, axis=0)
            tilt = float(np.arccos(np.clip(mean[2] / np.linalg.norm(mean), -1.0, 1.0)))
            if tilt > MOST_TILT:
                found.append(
                    f"the ground is tilted by {np.degrees(tilt):.0f} degrees in the world of the "
                    "source, so the map is foreshortened: --level turns the world"
                )
        return found


def open_source(
    path: Path,
    *,
    format: str | None = None,
    poses: Path | None = None,
    scale: float | None = None,
    scale_points: tuple[str, str, float] | None = None,
    camera_height: float | None = None,
    level: bool | None = None,
    point_noise: float | None = None,
    guess_visibility: bool = False,
) -> Source:
    """Open a source of views, and determine its scale and its direction up.

    Parameters
    ----------
    path : Path
    format : str, optional
    poses : Path, optional
    scale : float, optional
    scale_points : tuple, optional
    camera_height : float, optional [m]
        Gives the scale of a source without a unit; otherwise `Source.camera_height`.
    level : bool, optional
    point_noise : float, optional
    guess_visibility : bool, default False

    Raises
    ------
    InputError
        The source has no view, or options are invalid.
    """
    log = read_views(
        path, format=format, poses=poses, point_noise=point_noise, guess_visibility=guess_visibility
    )
    if not len(log):
        raise InputError(str(path), "at least one view", "none")
    scaled = is_metric(log) or scale is not None or scale_points is not None
    views = align(
        log,
        scale=scale,
        camera_height=None if scaled else camera_height,
        scale_points=None if scale_points is None else ScalePoints(*scale_points),
        level=level,
    )
    metric = scaled or camera_height is not None
    return Source(views, metric, camera_height if scaled else None)


def describe_map(log: SparseMapLog) -> dict[str, Any]:
    """Return the contents of a sparse map as JSON values."""
    sparse = log.sparse
    return {
        "system": sparse.system,
        "views": len(sparse),
        "landmarks": sparse.landmark_count,
        "sightings": sparse.sightings,
        "dropped": dict(sparse.dropped),
        "wide_views": log.split_views,
        "notes": list(sparse.notes),
    }


def describe_sentence(log: SparseMapLog) -> str:
    """Return a sentence about the contents of a sparse map."""
    sparse = log.sparse
    sentence = (
        f"{sparse.system}: {len(sparse):,} views, {sparse.landmark_count:,} landmarks, "
        f"{sparse.sightings:,} sightings"
    )
    dropped = ", ".join(
        f"{count:,} {reason.replace('_', ' ')}" for reason, count in sparse.dropped.items()
    )
    if dropped:
        sentence += f" (dropped: {dropped})"
    if log.split_views:
        sentence += f"; {log.split_views:,} wide views are split into flat ones"
    return sentence
