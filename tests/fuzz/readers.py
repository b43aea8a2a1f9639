"""Targets that read files: each writes whole files, damages one, and reads them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from fuzz import samples
from fuzz.arrays import archive, damaged_archive, members_of
from fuzz.case import OutputError, Target
from fuzz.draw import Draw
from fuzz.mutate import damaged, damaged_bytes
from fuzz.samples import Files
from groundmap import CellState, ConfidenceGrid, Places, load_map, read_views, recognise
from groundmap.io.alignment import align
from groundmap.io.movingai_scen import read_movingai_scen
from groundmap.simulate import drive
from planners import PlanningProblem, Roadmap, plan, read_keep_out
from planners.commands.settings_file import read_settings
from planners.scenario.case import load_scenario
from sample_views import few_views

MOST_POSES = 10_000  # of a drive that is driven here


class Reader(Target):
    """A target whose input is files, so that a case can be kept and read again."""

    def run(self, draw: Draw, folder: Path) -> None:
        """Write damaged files into a folder, and read them."""
        for name, data in self.files(draw).items():
            (folder / name).write_bytes(data)
        self.read(folder)

    @abstractmethod
    def files(self, draw: Draw) -> Files:
        """Return the files of a case by name, damaged."""

    @abstractmethod
    def read(self, folder: Path) -> None:
        """Read the files, and use what they hold as far as every caller would."""


class Texts(Reader):
    """Text files, of which one is damaged."""

    damage: Callable[[bytes, Draw], bytes] = staticmethod(damaged)

    def __init__(
        self,
        name: str,
        files: Mapping[str, bytes],
        read: Callable[[Path], object],
        *,
        weight: float = 1.0,
    ) -> None:
        super().__init__(name, weight)
        self._files, self._read = files, read

    def whole(self) -> Files:
        """Return the files undamaged."""
        return dict(self._files)

    def files(self, draw: Draw) -> Files:
        """Return the files, most often one of them damaged."""
        files = self.whole()
        for _ in range(draw.pick((1, 1, 1, 2))):
            name = draw.pick(sorted(files))
            files[name] = self.damage(files[name], draw)
        if len(files) > 1 and draw.chance(0.02):
            del files[draw.pick(sorted(files))]
        return files

    def read(self, folder: Path) -> None:
        """Read them."""
        self._read(folder)


class Binaries(Texts):
    """Files of which one is damaged without regard to what its bytes mean."""

    damage = staticmethod(damaged_bytes)


class Archives(Reader):
    """An archive of arrays, damaged, beside text files that are whole."""

    def __init__(
        self,
        name: str,
        file: str,
        arrays: Callable[[], Mapping[str, Any]],
        read: Callable[[Path], object],
        *,
        beside: Mapping[str, bytes] | None = None,
        weight: float = 1.0,
    ) -> None:
        super().__init__(name, weight)
        self._file, self._arrays, self._read = file, arrays, read
        self._beside = beside or {}

    def whole(self) -> Files:
        """Return the archive undamaged, and what lies beside it."""
        return {**self._beside, self._file: archive(members_of(self._arrays()))}

    def files(self, draw: Draw) -> Files:
        """Return the archive damaged, and what lies beside it."""
        return {**self._beside, self._file: damaged_archive(self._arrays(), draw)}

    def read(self, folder: Path) -> None:
        """Read it."""
        self._read(folder)


class RosMap(Reader):
    """A map of map_server: the text, the image, or both are damaged."""

    def whole(self) -> Files:
        """Return a ``.yaml`` file and its image."""
        return {"map.yaml": samples.YAML, "map.png": samples.picture("L", "PNG")}

    def files(self, draw: Draw) -> Files:
        """Return a ``.yaml`` file and its image, of which one is damaged, or both."""
        mode, kind = draw.pick(samples.PICTURES)
        text, image = samples.YAML, samples.picture(mode, kind)
        name = f"map.{kind.lower()}"
        text = text.replace(b"map.png", name.encode())
        if draw.chance(0.5):
            text = damaged(text, draw)
        if draw.chance(0.6):
            # The heads of PGM files are text.
            damage = damaged if kind == "PPM" and draw.chance(0.5) else damaged_bytes
            image = damage(image, draw)
        return {"map.yaml": text, name: image}

    def read(self, folder: Path) -> None:
        """Read the map."""
        use_map(load_map(folder / "map.yaml"))


def use_map(grid: ConfidenceGrid) -> None:
    """Use a map that was read as every command does.

    Raises
    ------
    OutputError
        It holds what no map may hold.
    """
    if not (np.isfinite(grid.bounds()).all() and 0 < grid.resolution < np.inf):
        raise OutputError(f"a map with bounds {grid.bounds()} and cells of {grid.resolution} m")
    areas = [grid.area(state) for state in CellState]
    if not np.isfinite(areas).all():
        raise OutputError(f"a map with areas of {areas}")
    grid.confidence_at(grid.bounds()[: grid.ndim])
    grid.copy()


def _views(folder: Path) -> None:
    for view in islice(read_views(folder), 50):
        if not np.isfinite(view.points.xyz).all():
            raise OutputError("a view with points that are not finite")


def _sparse_views(folder: Path) -> None:
    log = read_views(folder)
    for view in islice(log, 50):
        if not np.isfinite(view.points.covariance).all():
            raise OutputError("a view with covariances that are not finite")
    align(log)


def _guessed_views(folder: Path) -> None:
    for view in islice(read_views(folder, guess_visibility=True), 50):
        len(view.points)


def _posed_views(folder: Path) -> None:
    for view in read_views(folder, poses=folder / "other.txt"):
        len(view.points)


def _scenario(folder: Path) -> None:
    scenario = load_scenario(folder / "scenario.toml")
    if scenario.drive is not None and _poses(scenario.drive) <= MOST_POSES:
        drive(scenario.drive, np.random.default_rng(scenario.seed))


def _poses(settings: Any) -> float:
    stops = np.array(settings.stops, dtype=np.float64)
    with np.errstate(all="ignore"):
        way = np.abs(np.diff(stops, axis=0)).sum(axis=0)
        return float((way[0] + way[1]) / settings.every + way[2] / settings.every_turn)


def _places(folder: Path) -> None:
    (view,) = few_views(1)
    recognise(view, Places.load(folder / "places.npz"))


def _roadmap(folder: Path) -> None:
    problem = samples.roadmap_problem()
    roadmap = Roadmap.load(folder / "roadmap.npz", problem)
    roadmap.plan((2, 2), (10, 2))


FOLDER: Files = {
    "rig.toml": samples.RIG,
    "poses.txt": samples.TUM,
    "points.csv": samples.POINTS,
    "segments.csv": samples.SEGMENTS,
}
XYZ: Files = {**FOLDER, "points.csv": samples.POINTS_XYZ, "segments.csv": samples.SEGMENTS_XYZ}
POSITIONS: Files = {
    "rig.toml": b'world = "optical"\n',
    "poses.txt": samples.TUM,
    "points.csv": b"view,id,x,y,z\n0,1,0.5,1.2,5\n0,2,0.1,1.2,7\n1,1,0.4,1.2,4.5\n2,-1,1,1,6\n",
}
ARCHIVED: Files = {"rig.toml": samples.RIG, "poses.txt": samples.TUM}


def _keep_out(folder: Path) -> None:
    """Plan around the areas of a file."""
    areas = read_keep_out(folder / "areas.geojson")
    on = ConfidenceGrid(resolution=0.5)
    on.fuse(np.array([0, 0]), np.full((24, 24), -1.0, dtype=np.float32))
    plan(PlanningProblem(on, start=(1, 1), goal=(11, 11), footprint=0.4, keep_out=areas))


READERS: tuple[Texts | Archives | RosMap, ...] = (
    Texts("gtsam", samples.GTSAM, _views, weight=2),
    Texts("folder", FOLDER, _views, weight=2),
    Texts("folder-xyz", XYZ, _views),
    Texts("poses-gtsam", {**samples.GTSAM, "other.txt": samples.BY_ID}, _posed_views, weight=0.5),
    Texts("poses-folder", {**FOLDER, "other.txt": samples.TUM}, _posed_views, weight=0.5),
    Texts("folder-positions", POSITIONS, _views),
    *(Texts(name, files, _sparse_views) for name, files in samples.text_maps().items()),
    *(Binaries(name, files, _sparse_views) for name, files in samples.binary_maps().items()),
    Texts("map-guessed", samples.unseen_map(), _guessed_views),
    Archives("folder-npz", "features.npz", samples.tables, _views, beside=ARCHIVED),
    *(
        Archives(
            f"map-{kind}",
            "map.npz",
            lambda kind=kind: samples.grids()[kind],  # type: ignore[misc]  # of the loop's variable
            lambda folder: use_map(load_map(folder / "map.npz")),
        )
        for kind in ("flat", "capped", "deep")
    ),
    RosMap("ros-map", weight=3),
    Texts("movingai", {"a.map": samples.MOVINGAI}, lambda f: use_map(load_map(f / "a.map"))),
    Texts("voxels", {"a.3dmap": samples.VOXELS}, lambda f: use_map(load_map(f / "a.3dmap"))),
    Texts("scen", {"a.scen": samples.SCEN}, lambda f: read_movingai_scen(f / "a.scen")),
    Texts("scen-3d", {"a.3dscen": samples.SCEN_3D}, lambda f: read_movingai_scen(f / "a.3dscen"),
          weight=0.5),
    Texts("scenario", {"scenario.toml": samples.SCENARIO}, _scenario, weight=2),
    Texts("settings", {"s.toml": samples.SETTINGS}, lambda f: read_settings(f / "s.toml")),
    Texts("keep-out", {"areas.geojson": samples.KEEP_OUT}, _keep_out),
    Archives("places", "places.npz", samples.places, _places),
    Archives("roadmap", "roadmap.npz", samples.roadmap, _roadmap),
)  # fmt: skip
