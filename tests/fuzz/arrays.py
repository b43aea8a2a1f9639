"""Archives of arrays (.npz) that are damaged member by member."""

from __future__ import annotations

import io
import json
import warnings
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fuzz.draw import Draw
from fuzz.mutate import damaged, damaged_bytes
from fuzz.values import NUMBERS

Members = dict[str, bytes]
NAMES = ("header", "points", "confidence", "a/b", "../x", "", "x.npy", "index", "\u202e", "a" * 300)
TYPES = ("f4", "f8", "f2", ">f8", "i8", "u1", "?", "c16", "U9", "S3", "M8[s]", "O", "V8")
SHAPES = ("(14, 2)", "(99999999999,)", "(-1,)", "()", "(0,)", "(2, 0)", "(3,)", "(1,1,1,1)",
          "(4000000000, 1000)", "(2.5,)", "[2]", "None", "(300000000,)", "(" * 300)  # fmt: skip

VALUES: tuple[Any, ...] = (
    None, [], {}, "", "x" * 3000, 1e400, float("nan"), -1, 0, 2**70, True, [1], [[0, 0]],
    {"name": []}, [0, 0, 0], "\x00", "\ud800", 10**400, {"name": "capped", "cap": 2**70},
    {"name": "capped", "cap": 1.5}, [1e300, 1e300], 1e-300, 1e300,
)  # fmt: skip


def damaged_archive(arrays: Mapping[str, Any], draw: Draw) -> bytes:
    """Return the bytes of an archive of these arrays after some damage."""
    if draw.chance(0.15):
        return damaged_bytes(archive(members_of(arrays)), draw)
    changed = dict(arrays)
    for _ in range(draw.pick((1, 1, 1, 2, 3))):
        if changed:
            draw.pick(ARRAY_DAMAGES)(changed, draw)
    members = members_of(changed)
    if members and draw.chance(0.3):
        draw.pick(MEMBER_DAMAGES)(members, draw)
    return archive(members, method=draw.pick((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED)))


def members_of(arrays: Mapping[str, Any]) -> Members:
    """Return the files in an archive of these arrays."""
    members = {}
    for name, values in arrays.items():
        stream = io.BytesIO()
        np.lib.format.write_array(stream, np.asarray(values), allow_pickle=True)
        members[f"{name}.npy"] = stream.getvalue()
    return members


def archive(members: Members, *, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return the bytes of a zip archive of these files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as zipped:
        for name, data in members.items():
            zipped.writestr(zipfile.ZipInfo(name or "x"), data, method)
    return stream.getvalue()


def _drop(arrays: dict[str, Any], draw: Draw) -> None:
    del arrays[draw.pick(sorted(arrays))]


def _rename(arrays: dict[str, Any], draw: Draw) -> None:
    arrays[draw.pick(NAMES)] = arrays.pop(draw.pick(sorted(arrays)))


def _exchange(arrays: dict[str, Any], draw: Draw) -> None:
    a, b = draw.pick(sorted(arrays)), draw.pick(sorted(arrays))
    arrays[a], arrays[b] = arrays[b], arrays[a]


def _entry(arrays: dict[str, Any], draw: Draw) -> None:
    """Change one number of one array."""
    name = draw.pick(sorted(arrays))
    values = np.array(arrays[name], copy=True)
    if values.size and values.dtype.kind in "fiu":
        with np.errstate(all="ignore"):
            try:
                values.reshape(-1)[draw.whole(0, values.size - 1)] = draw.pick(NUMBERS)
            except (OverflowError, ValueError):
                values = values.astype("f8") * 1e9
    arrays[name] = values


def _cast(arrays: dict[str, Any], draw: Draw) -> None:
    name = draw.pick(sorted(arrays))
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
        try:
            arrays[name] = np.asarray(arrays[name]).astype(draw.pick(TYPES))
        except (TypeError, ValueError):
            arrays[name] = np.zeros(2, dtype=[("a", "f8"), ("b", "i4")])


def _reshape(arrays: dict[str, Any], draw: Draw) -> None:
    name = draw.pick(sorted(arrays))
    values = np.asarray(arrays[name])
    changes: tuple[Callable[[Any], Any], ...] = (
        np.ravel, np.transpose, lambda a: a[None], lambda a: a[..., :0], lambda a: a[..., :-1],
        lambda a: a[:0], lambda a: a[:-1], lambda a: np.concatenate([a, a]), lambda a: a[::-1],
    )  # fmt: skip
    arrays[name] = draw.pick(changes)(np.atleast_1d(values))


def _header(arrays: dict[str, Any], draw: Draw) -> None:
    """Damage the JSON text of the member ``header``."""
    if "header" not in arrays:
        return _entry(arrays, draw)
    text = str(arrays["header"])
    if draw.chance(0.5):
        arrays["header"] = np.array(damaged(text.encode(), draw).decode("utf-8", "replace"))
        return None
    try:
        values = json.loads(text)
        key = draw.pick(sorted(values))
    except (ValueError, TypeError, IndexError):
        return None
    values[key] = draw.pick(VALUES)
    if draw.chance(0.1):
        del values[key]
    arrays["header"] = np.array(json.dumps(values))
    return None


def _lie(members: Members, draw: Draw) -> None:
    """Write another shape or type into the head of a member, in as many bytes."""
    name = draw.pick(sorted(members))
    data = members[name]
    head = len(data[:10]) + int.from_bytes(data[8:10], "little")
    text = data[10:head].decode("latin-1")
    start = text.find("'shape': ")
    if start < 0:
        return
    if draw.chance(0.5):
        new = f"{text[:start]}'shape': {draw.pick(SHAPES)}, }}"
    else:
        new = f"{{'descr': '{draw.pick(TYPES)}', {text[text.find(chr(39) + 'fortran') :]}"
    padded = new.strip().ljust(head - 11)[: max(head - 11, len(new.strip()))] + "\n"
    size = len(padded).to_bytes(2, "little")
    members[name] = data[:8] + size + padded.encode("latin-1", "replace") + data[head:]


def _bytes(members: Members, draw: Draw) -> None:
    name = draw.pick(sorted(members))
    members[name] = damaged_bytes(members[name], draw)


def _no_array(members: Members, draw: Draw) -> None:
    name = draw.pick(sorted(members))
    data = members.pop(name)
    members[draw.pick((name, name.removesuffix(".npy"), "readme.txt", "a/", name.upper()))] = (
        draw.pick((b"", b"hello", data[:6], data[:20], data + b"x"))
    )


ARRAY_DAMAGES: tuple[Callable[[dict[str, Any], Draw], None], ...] = (
    _drop, _rename, _exchange, _entry, _entry, _entry, _cast, _cast, _reshape, _reshape, _header,
    _header, _header,
)  # fmt: skip
MEMBER_DAMAGES: tuple[Callable[[Members, Draw], None], ...] = (_lie, _lie, _bytes, _no_array)
