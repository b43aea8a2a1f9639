"""The settings of a scenario: a world or a log, sensor, mapper, queries and bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

from groundmap.errors import FileFormatError, InputError
from groundmap.files.documents import read_toml
from groundmap.settings import GroundSettings, MapperSettings, Settings
from groundmap.simulate.drive import DriveSettings
from groundmap.simulate.scan import ScanSettings
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world_file import HoleSettings, ReliefSettings, SolidSettings
from groundmap.simulate.worlds import GENERATORS, WorldGenerator
from planners.scenario.outcome import Bound
from planners.scenario.queries import QuerySettings, bound_from, check_query, check_stated_once

FILE = "scenario.toml"


class LogSettings(Settings):
    """A recorded log instead of a world."""

    path: str = Field(description="folder of the log, relative to the scenario's file")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A validated scenario."""

    name: str
    path: Path  #: file of the scenario
    why: str  #: purpose of the scenario
    seed: int
    level_ground: bool  #: whether the true ground plane is given, instead of fitted
    flies: bool  #: whether views have no ground plane
    heights: tuple[float, float]  #: lowest and highest z at which a 3-D map is measured [m]
    log: Path | None
    world: WorldGenerator | None
    solids: tuple[SolidSettings, ...]
    holes: tuple[HoleSettings, ...]
    relief: ReliefSettings | None
    sensor: SensorSettings
    scan: ScanSettings | None
    drive: DriveSettings | None
    mapper: MapperSettings
    ground: GroundSettings
    queries: tuple[QuerySettings, ...]
    bounds: Mapping[str, Bound]  #: those of ``[bounds]``; `queries.bounds_of` has those of queries


def find_scenarios(places: Iterable[Path]) -> list[Path]:
    """Return the scenario files in folders, at any depth and sorted by path.

    Raises
    ------
    FileFormatError
        A place does not exist or contains no scenario.
    """
    paths: list[Path] = []
    for place in places:
        files = [place] if place.is_file() else sorted(place.rglob(FILE))
        if not files:
            raise FileFormatError(place, f"a folder with {FILE} files in it", "none")
        paths += files
    return list(dict.fromkeys(paths))


def load_scenario(path: Path) -> Scenario:
    """Return the scenario of a file, named after its folder.

    Raises
    ------
    FileFormatError
        The file is not TOML, has an unknown table or key (the nearest one is named), lacks one,
        or has a value out of range; or ``[bounds]`` has a bound on a figure that a query bounds
        too, although a figure has one bound.
    """
    content = read_toml(path, "a scenario file")
    try:
        return _scenario(path, content)
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(
            path, f"{error.name} to be {error.expected}", error.got, hint=error.hint
        ) from error


class ScenarioSettings(Settings):
    """Keys and tables of a scenario file."""

    why: str = Field(pattern=r"\S", description="purpose of the scenario")
    seed: int = Field(0, ge=0, description="seed of all random numbers")
    level_ground: bool = Field(
        False, description="use the true, level ground planes instead of fitted ones"
    )
    flies: bool = Field(
        False, description="whether the robot flies, so that views have no ground plane: in 3-D"
    )
    heights: tuple[float, float] = Field(
        (0.15, 2.0), description="lowest and highest z at which a 3-D map is measured [m]"
    )
    world: dict[str, Any] | None = None
    log: dict[str, Any] | None = None
    sensor: dict[str, Any] = Field(default_factory=dict)
    scan: dict[str, Any] | None = None
    drive: dict[str, Any] | None = None
    mapper: dict[str, Any] = Field(default_factory=dict)
    ground: dict[str, Any] = Field(default_factory=dict)
    queries: tuple[dict[str, Any], ...] = ()
    bounds: dict[str, dict[str, Any]] = Field(default_factory=dict)


def _scenario(path: Path, content: dict[str, Any]) -> Scenario:
    head = ScenarioSettings(**content)
    if (head.world is None) == (head.log is None):
        got = "neither" if head.log is None else "both"
        raise FileFormatError(path, "a [world] or a [log]", got)
    if head.world is not None and head.drive is None:
        raise FileFormatError(path, "a [drive] through its [world]", "none")
    world = dict(head.world or {})
    solids = tuple(SolidSettings(**table) for table in _tables(world, "solids"))
    holes = tuple(HoleSettings(**table) for table in _tables(world, "holes"))
    relief = world.pop("relief", None)
    if relief is not None:
        if not isinstance(relief, dict):
            raise InputError("world.relief", "a [world.relief] table", repr(relief))
        relief = ReliefSettings(**relief)
        relief.relief()
        if head.scan is not None:
            raise FileFormatError(path, "flat ground with [scan]", "[world.relief]")
    for solid in solids:  # an invalid shape raises here, before the scenario runs
        solid.solids()
    for hole in holes:
        hole.hole()
    queries = tuple(QuerySettings(**table) for table in head.queries)
    for query in queries:
        check_query(query)
    names = [query.name for query in queries]
    if len(set(names)) < len(names):
        raise InputError("queries", "of different names", ", ".join(names))
    bounds = {name: bound_from(name, table) for name, table in head.bounds.items()}
    for query in queries:
        check_stated_once(query, bounds, known_world=head.log is None)
    return Scenario(
        name=path.resolve().parent.name if path.name == FILE else path.stem,
        path=path,
        why=" ".join(head.why.split()),
        seed=head.seed,
        level_ground=head.level_ground,
        flies=head.flies,
        heights=head.heights,
        log=None if head.log is None else path.parent / LogSettings(**head.log).path,
        world=None if head.world is None else _generator(world, path.parent),
        solids=solids,
        holes=holes,
        relief=relief,
        sensor=SensorSettings(**head.sensor),
        scan=None if head.scan is None else ScanSettings(**head.scan),
        drive=None if head.drive is None else DriveSettings(**head.drive),
        mapper=MapperSettings(**head.mapper),
        ground=GroundSettings(**head.ground),
        queries=queries,
        bounds=bounds,
    )


def _tables(world: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Remove the tables of a name from the world's table, and return them."""
    tables = world.pop(name, [])
    if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        raise InputError(f"world.{name}", f"[[world.{name}]] tables", repr(tables))
    return tables


def _generator(table: dict[str, Any], folder: Path) -> WorldGenerator:
    kind = table.pop("kind", "empty")
    if not isinstance(kind, str) or kind not in GENERATORS:
        raise InputError("world.kind", f"one of {', '.join(sorted(GENERATORS))}", repr(kind))
    if isinstance(table.get("path"), str):  # relative to the scenario's file
        table["path"] = str(folder / table["path"])
    return GENERATORS[kind](**table)
