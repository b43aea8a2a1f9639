"""A scenario as its file has it: a world or a log, what is mapped of it, what it must keep."""

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
from groundmap.simulate.world_file import HoleSettings, SolidSettings
from groundmap.simulate.worlds import GENERATORS, WorldGenerator
from planners.scenario.outcome import Bound
from planners.scenario.queries import QuerySettings, bound_from, check_query, check_stated_once

FILE = "scenario.toml"


class LogSettings(Settings):
    """A recorded log instead of a world."""

    path: str = Field(description="folder of the log, from the scenario's file on")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One case, validated."""

    name: str
    path: Path  #: of its file
    why: str  #: the reason that it exists
    seed: int
    level_ground: bool  #: whether the ground is given, instead of fitted
    log: Path | None
    world: WorldGenerator | None
    solids: tuple[SolidSettings, ...]
    holes: tuple[HoleSettings, ...]
    sensor: SensorSettings
    scan: ScanSettings | None
    drive: DriveSettings | None
    mapper: MapperSettings
    ground: GroundSettings
    queries: tuple[QuerySettings, ...]
    bounds: Mapping[str, Bound]  #: of ``[bounds]``; `queries.bounds_of` gives those of the queries


def find_scenarios(places: Iterable[Path]) -> list[Path]:
    """Return the scenario files in folders, at any depth, by name.

    Raises
    ------
    FileFormatError
        A place that does not exist, or holds no scenario.
    """
    found: list[Path] = []
    for place in places:
        files = [place] if place.is_file() else sorted(place.rglob(FILE))
        if not files:
            raise FileFormatError(place, f"a folder with {FILE} files in it", "none")
        found += files
    return list(dict.fromkeys(found))


def load_scenario(path: Path) -> Scenario:
    """Return the scenario of a file, called after its folder.

    Raises
    ------
    FileFormatError
        Not TOML; a table or a key that a scenario does not have (the nearest is named), one that
        it lacks, or a value out of its range; a bound in ``[bounds]`` on a figure that a query
        holds itself. Neither replaces the other: state each figure's bound in one place.
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
    """What stands before the tables, and the tables' names."""

    why: str = Field(pattern=r"\S", description="the reason that the scenario exists")
    seed: int = Field(0, ge=0, description="of all random numbers")
    level_ground: bool = Field(
        False, description="give the ground's planes, level and where they are, instead of fitting"
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
    for solid in solids:  # what has no shape is refused here, not when it is run
        solid.solids()
    for hole in holes:
        hole.hole()
    queries = tuple(QuerySettings(**table) for table in head.queries)
    for query in queries:
        check_query(query)
    names = [query.name for query in queries]
    if len(set(names)) < len(names):
        raise InputError("queries", "a name of its own for each", ", ".join(names))
    bounds = {name: bound_from(name, table) for name, table in head.bounds.items()}
    for query in queries:
        check_stated_once(query, bounds, known_world=head.log is None)
    return Scenario(
        name=path.resolve().parent.name if path.name == FILE else path.stem,
        path=path,
        why=" ".join(head.why.split()),
        seed=head.seed,
        level_ground=head.level_ground,
        log=None if head.log is None else path.parent / LogSettings(**head.log).path,
        world=None if head.world is None else _generator(world, path.parent),
        solids=solids,
        holes=holes,
        sensor=SensorSettings(**head.sensor),
        scan=None if head.scan is None else ScanSettings(**head.scan),
        drive=None if head.drive is None else DriveSettings(**head.drive),
        mapper=MapperSettings(**head.mapper),
        ground=GroundSettings(**head.ground),
        queries=queries,
        bounds=bounds,
    )


def _tables(world: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Take the tables of a name out of the world's."""
    tables = world.pop(name, [])
    if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        raise InputError(f"world.{name}", f"[[world.{name}]] tables", repr(tables))
    return tables


def _generator(table: dict[str, Any], folder: Path) -> WorldGenerator:
    kind = table.pop("kind", "empty")
    if not isinstance(kind, str) or kind not in GENERATORS:
        raise InputError("world.kind", f"one of {', '.join(sorted(GENERATORS))}", repr(kind))
    if isinstance(table.get("path"), str):  # from the scenario's file on
        table["path"] = str(folder / table["path"])
    return GENERATORS[kind](**table)
