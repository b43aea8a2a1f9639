"""Targets that run a command on damaged files: it ends with 0, 2 or 3 and one sentence."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from fuzz import samples
from fuzz.arrays import archive, damaged_archive, members_of
from fuzz.case import OutputError, check_sentence
from fuzz.draw import Draw
from fuzz.mutate import damaged
from fuzz.readers import FOLDER, Reader
from fuzz.samples import Files
from planners.cli import main

MISSED = 1  # of a bound, which no command here has


class Command(Reader):
    """A command of ``groundmap`` on files of which one is damaged.

    Parameters
    ----------
    name : str
    arguments : tuple of str
        With ``{}`` for the folder.
    files : callable
        Returns the files of a case.
    weight : float
    """

    def __init__(
        self,
        name: str,
        arguments: tuple[str, ...],
        files: Callable[[Draw], Files],
        *,
        weight: float = 1.0,
    ) -> None:
        super().__init__(name, weight)
        self._arguments, self._files = arguments, files

    def files(self, draw: Draw) -> Files:
        """Return the files."""
        return self._files(draw)

    def read(self, folder: Path) -> None:
        """Run the command.

        Raises
        ------
        OutputError
            Another exit code, or something else than one sentence.
        """
        out, err = io.StringIO(), io.StringIO()
        try:
            with redirect_stdout(out), redirect_stderr(err):
                main([argument.replace("{}", str(folder)) for argument in self._arguments])
        except SystemExit as ended:
            check_ending(ended.code, err.getvalue())


def check_ending(code: object, err: str) -> None:
    """Check how a command ended.

    Raises
    ------
    OutputError
    """
    if code not in (0, 2, 3):
        raise OutputError(f"exit {code}: {err[:500]!r}")
    lines = err.splitlines()
    for line in lines:
        check_sentence(line)
    if code != 0 and len(lines) != 1:
        raise OutputError(f"exit {code} with {len(lines)} lines: {err[:500]!r}")


def _map_file(draw: Draw) -> Files:
    return {"map.npz": damaged_archive(samples.grids()[draw.pick(("flat", "deep"))], draw)}


def _ros_files(draw: Draw) -> Files:
    return {"map.yaml": damaged(samples.YAML, draw), "map.png": samples.picture("L", "PNG")}


def _log(draw: Draw) -> Files:
    files = dict(FOLDER)
    name = draw.pick(sorted(files))
    files[name] = damaged(files[name], draw)
    files["settings.toml"] = samples.SETTINGS
    if draw.chance(0.3):
        files["settings.toml"] = damaged(samples.SETTINGS, draw)
    return files


def _routed(draw: Draw) -> Files:
    files = {"map.npz": archive(members_of(samples.grids()["capped"]))}
    return {**files, "route.geojson": damaged(samples.GEOJSON, draw)}


PLACES = ("--start", "1,1", "--goal", "3,3", "--footprint", "0.3", "--unknown", "allow")
LOG = ("map", "{}", "--out", "{}/out.npz", "--config", "{}/settings.toml", "--camera-height", "1.2")
COMMANDS: tuple[Command, ...] = (
    Command("command-info", ("info", "{}/map.npz"), _map_file),
    Command("command-info-ros", ("info", "{}/map.yaml", "--json"), _ros_files),
    Command("command-convert", ("convert", "{}/map.npz", "{}/out.yaml"), _map_file),
    Command("command-plan", ("plan", "{}/map.npz", *PLACES), _map_file, weight=0.5),
    Command("command-plan-ros", ("plan", "{}/map.yaml", *PLACES), _ros_files, weight=0.5),
    Command("command-map", LOG, _log, weight=0.3),
    Command(
        "command-plot",
        ("plot", "{}/map.npz", "--route", "{}/route.geojson", "--out", "{}/out.png"),
        _routed,
        weight=0.05,
    ),
)
