"""The compressed chunks of bags: their true size is checked before the whole bag is read."""

from __future__ import annotations

import bz2
import importlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file

EXPECTED = "a ROS bag"
BAG1, MCAP = b"#ROSBAG V2.0", b"\x89MCAP0\r\n"
MOST_OF_A_CHUNK = 2**29  # bytes, uncompressed
MOST_OF_A_RECORD = 2**30  # bytes, as stored
MCAP_CHUNK, BAG1_CHUNK = 0x06, 5
MCAP_HEAD = struct.Struct("<QQQI")  # times, uncompressed size, checksum
PLAIN = {"", "none"}


class Chunk(NamedTuple):
    """A chunk as a bag describes it."""

    compression: str
    size: int  #: uncompressed [bytes]
    data: bytes


def check_chunks(path: Path) -> None:
    """Check that the chunks of a bag have the size that they state, and a bounded one.

    Parameters
    ----------
    path : Path
        A file of a bag, or the folder of a bag of ROS 2.

    Raises
    ------
    FileFormatError
        A chunk is larger than it states, or than 512 MB.
    """
    files = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    for file in files:
        with open_file(file, EXPECTED) as stream:
            head = stream.read(len(BAG1))
            if head == BAG1:
                chunks = _bag1_chunks(stream)
            elif head.startswith(MCAP):
                chunks = _mcap_chunks(stream)
            else:
                continue
            for number, chunk in enumerate(chunks):
                _check(file, number, chunk)


def _check(path: Path, number: int, chunk: Chunk) -> None:
    if chunk.size > MOST_OF_A_CHUNK:
        expected = f"chunks of at most {MOST_OF_A_CHUNK} bytes"
        raise FileFormatError(path, expected, f"{chunk.size} in chunk {number}")
    if chunk.compression in PLAIN:
        return
    decompressor = _decompressor(chunk.compression)
    if decompressor is None:  # the library names it
        return
    size = len(decompressor.decompress(chunk.data, max_length=chunk.size + 1))
    if size != chunk.size:
        more = " or more" if size > chunk.size else ""
        expected = f"{chunk.size} bytes in chunk {number}, as it states"
        raise FileFormatError(path, expected, f"{size}{more}")


def _decompressor(compression: str) -> Any:
    """Return a decompressor with a bounded output, or None for an unknown compression."""
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    if compression == "lz4":
        return importlib.import_module("lz4.frame").LZ4FrameDecompressor()
    if compression == "zstd":
        for name in ("compression.zstd", "backports.zstd"):  # the standard library's, since 3.14
            try:
                return importlib.import_module(name).ZstdDecompressor()
            except ImportError:
                continue
    return None


def _mcap_chunks(stream: BinaryIO) -> Iterator[Chunk]:
    stream.seek(len(MCAP))
    while len(head := stream.read(9)) == 9:
        operation, length = struct.unpack("<BQ", head)
        if operation != MCAP_CHUNK or length > MOST_OF_A_RECORD:
            if length > MOST_OF_A_RECORD:
                return
            stream.seek(length, 1)
            continue
        record = stream.read(length)
        place = MCAP_HEAD.size
        _, _, size, _ = MCAP_HEAD.unpack_from(record)
        (name,) = struct.unpack_from("<I", record, place)
        start = place + 4 + name
        compression = record[place + 4 : start].decode("ascii", "replace")
        yield Chunk(compression, size, record[start + 8 :])


def _bag1_chunks(stream: BinaryIO) -> Iterator[Chunk]:
    stream.seek(len(BAG1) + 1)
    while len(head := stream.read(4)) == 4:
        (length,) = struct.unpack("<I", head)
        fields = dict(_fields(stream.read(min(length, MOST_OF_A_RECORD))))
        size_bytes = stream.read(4)
        if len(size_bytes) < 4:
            return
        (size,) = struct.unpack("<I", size_bytes)
        if fields.get(b"op") != bytes([BAG1_CHUNK]) or size > MOST_OF_A_RECORD:
            stream.seek(size, 1)
            continue
        compression = fields.get(b"compression", b"none").decode("ascii", "replace")
        (stated,) = struct.unpack("<I", fields.get(b"size", b"").ljust(4, b"\0")[:4])
        yield Chunk(compression, stated, stream.read(size))


def _fields(header: bytes) -> Iterator[tuple[bytes, bytes]]:
    place = 0
    while place + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, place)
        name, _, value = header[place + 4 : place + 4 + length].partition(b"=")
        yield name, value
        place += 4 + length
