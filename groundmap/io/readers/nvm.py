"""Reader of VisualSFM's ``.nvm`` files.

A camera is a line of a name (to the tab), f, the quaternion w x y z of world to camera, the centre,
and the radial distortion. A point is a line of position, colour, and the views that saw it. A file
may contain several models, of which the largest is read.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.files.opening import read_file
from groundmap.io.readers.assembly import compose, poses_from
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.number_stream import MOST_BYTES, NumberStream
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

MATRICES = "NVM_V3_R9T"  # a variant with rotation matrices and translations
SHOWN = 60


class NvmLog(SparseMapLog):
    """Views of a file of VisualSFM."""

    looks_for = "a file that begins with NVM_V3"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins with NVM_V3."""
        return single_file(path, is_nvm) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read the largest model of a file."""
        file = single_file(path, is_nvm) or path
        text = read_file(file, "an NVM file", most=MOST_BYTES).decode("utf-8-sig", "replace")
        lines = _Lines(file, text)
        header = lines.next("a header").split()
        models: list[_Model] = []
        while not models or lines.left():
            model = _read_model(lines, matrices=header[0] == MATRICES)
            if model is None:
                break
            models.append(model)
        if not models:
            raise FileFormatError(file, "an NVM file with a model", "none")
        largest = max(models, key=lambda model: len(model.names))
        notes: tuple[str, ...] = ()
        if len(models) > 1:
            sizes = ", ".join(str(len(model.names)) for model in models)
            notes = (f"the file contains models of {sizes} views; the largest is used",)
        return _assemble(file, largest, notes)


def is_nvm(path: Path) -> bool:
    """Return whether a file begins with NVM_V3."""
    return head_of(path).startswith((b"NVM_V3", b"\xef\xbb\xbfNVM_V3"))


class _Model(NamedTuple):
    names: list[str]
    focals: Floats
    poses: Floats  # (n, 4, 4), camera to world
    points: NumberStream
    landmarks: int


class _Lines:
    """The lines of a file that are neither blank nor comments."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        lines = enumerate(text.splitlines(), start=1)
        self._lines = [
            (number, line) for number, line in lines if line.strip() and line.strip()[0] != "#"
        ]
        self.place = 0

    def left(self) -> int:
        return len(self._lines) - self.place

    def next(self, what: str) -> str:
        if not self.left():
            hint = "Was the file cut short?"
            raise FileFormatError(self.path, f"an NVM file: {what}", "the end", hint=hint)
        self.place += 1
        return self._lines[self.place - 1][1].strip("\r\n ")

    def count(self, what: str) -> int:
        text = self.next(f"the number of {what}").strip()
        if not text.isdigit() or int(text[:12]) > self.left():
            got = f"{text[:SHOWN]!r} before the last {self.left()} lines"
            raise FileFormatError(
                self.path, f"an NVM file: a number of {what}", got, line=self.line
            )
        return int(text)

    @property
    def line(self) -> int:
        """The number of the line that was read last."""
        return self._lines[self.place - 1][0]


def _read_model(lines: _Lines, *, matrices: bool) -> _Model | None:
    """Return the next model, or None for the end of the list of models."""
    views = lines.count("cameras")
    if not views:
        return None
    names, rows = [], []
    columns = 15 if matrices else 10
    for _ in range(views):
        line = lines.next("a camera")
        name, tab, rest = line.partition("\t")
        words = rest.split() if tab else line.rsplit(None, columns)[1:]
        names.append(name if tab else line.rsplit(None, columns)[0])
        rows.append(_numbers(lines, words, columns))
    table = np.array(rows)
    if matrices:
        poses = compose(table[:, 1:10].reshape(-1, 3, 3), table[:, 10:13], world_to_camera=True)
    else:
        still = poses_from(
            lines.path, table[:, 1:5], np.zeros((views, 3)), scalar_first=True, world_to_camera=True
        )
        poses = still
        poses[:, :3, 3] = table[:, 5:8]
    count = lines.count("points")
    text = "\n".join(lines.next("a point") for _ in range(count))
    return _Model(names, table[:, 0], poses, NumberStream(lines.path, "an NVM file", text), count)


def _numbers(lines: _Lines, words: list[str], columns: int) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        shown = repr(" ".join(words)[:SHOWN])
        raise FileFormatError(lines.path, "numbers of a camera", shown, line=lines.line) from error
    if len(numbers) != columns:
        expected = f"{columns} numbers after the name of a camera"
        raise FileFormatError(lines.path, expected, f"{len(numbers)}", line=lines.line)
    return numbers


def _assemble(path: Path, model: _Model, notes: tuple[str, ...]) -> SparseMap:
    places = np.empty((model.landmarks, 3))
    sightings = []
    for point in range(model.landmarks):
        places[point] = model.points.take(6, f"point {point}")[:3]
        views = model.points.count("views of a point", smallest=4)
        sightings.append(model.points.take(4 * views, "views of a point").reshape(-1, 4))
    table = np.concatenate([np.empty((0, 4)), *sightings])
    registered = model.focals > 0
    view_of = model.points.indices(table[:, 0], "cameras")
    wrong = np.flatnonzero((view_of < 0) | (view_of >= len(model.names)))
    if len(wrong):
        expected = f"indices of the {len(model.names)} cameras"
        raise FileFormatError(path, expected, str(view_of[wrong[0]]))
    known = registered[view_of]
    row_of = np.cumsum(registered) - 1
    landmark_of = np.repeat(np.arange(model.landmarks), [len(rows) for rows in sightings])
    dropped = {"unregistered_views": int((~registered).sum())}
    return SparseMap(
        system="VisualSFM",
        T_world_camera=model.poses[registered],
        landmarks=places,
        view_of=row_of[view_of[known]],
        landmark_of=landmark_of[known],
        names=tuple(np.array(model.names, dtype=object)[registered]),
        cameras=tuple(
            Camera(model="NVM", focal_px=float(focal)) for focal in model.focals[registered]
        )
        or (Camera(model="none"),),
        camera_of=np.arange(int(registered.sum())),
        pixels=table[known, 2:],
        dropped=+Counter(dropped),
        notes=notes,
    )
