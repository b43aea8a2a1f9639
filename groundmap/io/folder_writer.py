"""Writer of folders of views, in the format that `groundmap.io.folder` describes."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.files.opening import check_name
from groundmap.io.columns import KINDS, LARGEST_ID, LAYOUTS, Kind, values_of
from groundmap.io.folder import ARCHIVE, POSES, RIG, TABLES
from groundmap.io.rig import rig_values, write_rig
from groundmap.view.frames import to_quaternion
from groundmap.view.view import Features, View

OWN_FILES = {RIG, POSES, ARCHIVE, *TABLES.values()}


def write_views(
    views: Iterable[View],
    path: str | PathLike[str],
    *,
    features: str = "csv",
    overwrite: bool = False,
) -> None:
    """Write views to a folder that `read_views` reads back.

    Memory holds one view at a time. Features are restored bit by bit (the upper half of a
    covariance is written), poses to 1e-12. A rotation that is orthonormal only to a few digits is
    restored as the nearest true rotation, since it is written as a quaternion. The ground plane of
    a view and its counts of dropped features are not written.

    Parameters
    ----------
    views : iterable of View
        At least one, all with the same rig. The timestamp of a view without one is its index.
    path : path
        The folder to create, new or empty. It appears only after everything is written.
    features : {'csv', 'npz'}, default 'csv'
        Text tables, or one archive of arrays, which is faster but read into memory.
    overwrite : bool, default False
        Whether to replace a folder of views. A folder that holds other files is never replaced.

    Raises
    ------
    InputError
        No views, two rigs, a timestamp that is not finite, a folder that is not empty.
    OSError
        The folder's parent does not exist or is not writable.
    """
    if features not in WRITERS:
        raise InputError("features", f"one of {', '.join(WRITERS)}", repr(features))
    check_name(path, "a new or empty folder")
    target = Path(path).resolve()
    _check_target(target, overwrite)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as scratch:
        folder = Path(scratch) / "views"
        folder.mkdir()
        WRITERS[features](_write_poses(views, folder), folder)
        _swap(folder, target, Path(scratch) / "replaced")


def _check_target(target: Path, overwrite: bool) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError("path", "a new or empty folder", f"the file {target}")
    names = {entry.name for entry in target.iterdir()}
    if names and not overwrite:
        hint = "Give overwrite=True to replace it."
        raise InputError("path", "a new or empty folder", f"{target}, not empty", hint=hint)
    if names - OWN_FILES:
        other = f"{target}, which also holds {min(names - OWN_FILES)!r}"
        raise InputError("path", "a folder of views to overwrite", other)


def _swap(folder: Path, target: Path, aside: Path) -> None:
    replaced = target.exists()
    if replaced:
        target.rename(aside)
    try:
        folder.rename(target)
    except OSError:
        if replaced:
            aside.rename(target)
        raise


def _write_poses(views: Iterable[View], folder: Path) -> Iterator[tuple[int, View]]:
    """Write the rig and the poses of views, and yield the views with their indices."""
    rig: dict[str, Any] = {}
    with open(folder / POSES, "w", encoding="utf-8") as stream:
        stream.write("# timestamp tx ty tz qx qy qz qw\n")
        for index, view in enumerate(views):
            if not rig:
                rig = rig_values(view.rig)
                write_rig(folder / RIG, view.rig, "rep103")
            if rig_values(view.rig) != rig:
                hint = "Write the views of each rig to a folder of its own."
                raise InputError("views", "one rig", f"another in view {index}", hint=hint)
            stream.write(_pose_line(index, view))
            yield index, view
    if not rig:
        raise InputError("views", "at least one view", "none")


def _pose_line(index: int, view: View) -> str:
    timestamp = float(index) if view.timestamp is None else view.timestamp
    if not math.isfinite(timestamp):
        raise InputError("timestamp", "a finite number [s]", f"{timestamp} in view {index}")
    numbers = [timestamp, *view.T_map_base[:3, 3], *to_quaternion(view.T_map_base)]
    return " ".join(f"{number:.17g}" for number in numbers) + "\n"


def _header(kind: Kind) -> tuple[str, ...]:
    return LAYOUTS[kind][1].columns


def _write_csv(views: Iterable[tuple[int, View]], folder: Path) -> None:
    with ExitStack() as stack:
        streams = {}
        for kind, name in TABLES.items():
            streams[kind] = stack.enter_context(open(folder / name, "w", encoding="utf-8"))
            streams[kind].write(",".join(_header(kind)) + "\n")
        for index, view in views:
            for kind, stream in streams.items():
                stream.writelines(_csv_lines(index, getattr(view, kind)))


def _csv_lines(index: int, features: Features) -> Iterator[str]:
    rows = zip(features.ids.tolist(), values_of(features).tolist(), strict=True)
    for landmark, values in rows:
        # repr returns the shortest digits that restore the same float.
        yield f"{index},{landmark},{','.join(map(repr, values))}\n"


def _write_npz(views: Iterable[tuple[int, View]], folder: Path) -> None:
    with ExitStack() as stack:
        # np.savez needs complete arrays; as memory-mapped files, they need not fit in memory.
        files = {
            kind: stack.enter_context(tempfile.TemporaryFile(dir=folder.parent)) for kind in KINDS
        }
        counts = dict.fromkeys(KINDS, 0)
        for index, view in views:
            for kind, file in files.items():
                features: Features = getattr(view, kind)
                file.write(_array_rows(index, features).tobytes())
                counts[kind] += len(features)
        arrays: dict[str, npt.NDArray[Any]] = {}
        for kind, file in files.items():
            file.flush()
            shape = (counts[kind], len(_header(kind)))
            arrays[kind] = np.memmap(file, dtype=np.float64, mode="r+", shape=shape)
            arrays[f"{kind}_columns"] = np.array(_header(kind))
        np.savez(folder / ARCHIVE, allow_pickle=False, **arrays)


def _array_rows(index: int, features: Features) -> Floats:
    if ((features.ids > LARGEST_ID) | (features.ids < -LARGEST_ID)).any():
        hint = "Write them with features='csv'."
        raise InputError("ids", "ids up to 2**53", f"larger ones in view {index}", hint=hint)
    views = np.full(len(features), index)
    return np.column_stack([views, features.ids, values_of(features)]).astype(np.float64)


WRITERS: dict[str, Callable[[Iterable[tuple[int, View]], Path], None]] = {
    "csv": _write_csv,
    "npz": _write_npz,
}
