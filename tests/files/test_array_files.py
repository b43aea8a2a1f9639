"""Archives of arrays of any origin: the arrays, or one error without memory allocated."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.errors import FileFormatError
from groundmap.files.array_files import read_arrays

HEADER = "{'descr': %s, 'fortran_order': False, 'shape': %s, }"


def member(descr: str = "'<f8'", shape: str = "(2,)", content: bytes = bytes(16)) -> bytes:
    """Return an array in NumPy's format, with a header of any content."""
    header = (HEADER % (descr, shape)).encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + content


def archive(
    folder: Path, members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED
) -> Path:
    path = folder / "x.npz"
    with zipfile.ZipFile(path, "w", compression) as made:
        for name, content in members.items():
            made.writestr(name, content)
    return path


@pytest.mark.parametrize(
    ("content", "got"),
    [
        (member(shape="(2000000000000,)"), r"2000000000000 values of float64 in 16 bytes"),
        (member(shape="(1,)"), r"1 values of float64 in 16 bytes"),
        (member(shape="(-1,)"), r"the shape \(-1,\)"),
        (member(shape="(2.0,)"), r"the shape \(2.0,\)"),
        (member(shape="(True,)"), r"the shape \(True,\)"),
        (member(shape="(" + "9" * 5000 + ",)"), "an invalid header"),
        (member(shape="(" * 3000), "something else, or a damaged file"),
        (member(descr="'<c16'", shape="(1,)"), "values of type '<c16'"),
        (member(descr="'|O'", shape="(2,)"), r"values of type '\|O'"),
        (member(descr="[('a', '<f8')]"), "values of type"),
        (member(descr="'<f8', 'x': 1"), "an invalid header"),
        (b"\x93NUMPY\x01\x00\xff\xff", "a header of 65535 bytes"),
        (b"text", "a member 'a.npy', which is not an array"),
        (b"", "a member 'a.npy', which is not an array"),
    ],
)
def test_a_member_that_is_not_an_array_of_numbers_is_refused(
    tmp_path: Path, content: bytes, got: str
) -> None:
    with pytest.raises(FileFormatError, match=rf"x.npz: expected an archive of arrays.*{got}"):
        read_arrays(archive(tmp_path, {"a.npy": content}))


def test_a_member_of_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"got a member 'notes.txt', which is not an array"):
        read_arrays(archive(tmp_path, {"a.npy": member(), "notes.txt": b"text"}))
    with pytest.raises(FileFormatError, match="got a compression other than deflate"):
        read_arrays(archive(tmp_path, {"a.npy": member()}, zipfile.ZIP_BZIP2))


def test_an_archive_that_claims_to_be_huge_allocates_no_memory(tmp_path: Path) -> None:
    path = archive(tmp_path, {"a.npy": member(shape="(2000000000000,)")}, zipfile.ZIP_STORED)
    whole, size = path.read_bytes(), len(member(shape="(2000000000000,)"))
    lying = whole.replace(size.to_bytes(4, "little"), (2**32 - 2).to_bytes(4, "little"))
    path.write_bytes(lying)
    tracemalloc.start()
    with pytest.raises(FileFormatError, match="bytes in a file of"):
        read_arrays(path)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


ARRAYS: list[Any] = [
    np.arange(6.0).reshape(2, 3),
    np.asfortranarray(np.arange(6, dtype=np.int16).reshape(2, 3)),
    np.arange(3, dtype=">u4"),
    np.array(True),
    np.array(["one", "zwei"]),
    np.array("text with \N{GREEK SMALL LETTER ALPHA}"),
    np.zeros((0, 4), dtype=np.float32),
    np.empty((), dtype=np.float16),
]


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_saved_by_numpy_are_read_as_by_numpy(tmp_path: Path, save: Any) -> None:
    save(tmp_path / "x.npz", *ARRAYS)
    found = read_arrays(tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz") as expected:
        assert list(found) == expected.files
        for name, array in found.items():
            assert array.dtype == expected[name].dtype.newbyteorder("=")
            assert array.flags.writeable
            npt.assert_array_equal(array, expected[name])


def _whole() -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, a=np.arange(50.0), b=np.array(["one", "two"]))
    return stream.getvalue()


WHOLE = _whole()


@given(
    st.lists(
        st.tuples(st.integers(0, len(WHOLE) - 1), st.integers(0, 255)), min_size=1, max_size=8
    ),
    st.integers(0, len(WHOLE)),
)
def test_a_damaged_archive_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]], length: int
) -> None:
    damaged = bytearray(WHOLE)
    for at, byte in changes:
        damaged[at] = byte
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    for content in (damaged, damaged[:length]):
        path.write_bytes(content)
        with suppress(FileFormatError):  # any other exception fails the test
            read_arrays(path)
