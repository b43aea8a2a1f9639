"""Archives: lossless, written completely or not at all, and other files are refused."""

from __future__ import annotations

import io
import json
import pickle
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from groundmap.errors import FileFormatError
from groundmap.files.archive import check_writable, read_archive, write_archive, write_atomically

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]

FORMAT = "test-archive"
HEADER = {"format": FORMAT, "version": 1, "resolution": 0.1524}

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
numbers = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False)
json_values = st.recursive(
    st.none() | st.booleans() | numbers | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=5,
)
arrays = hnp.arrays(
    st.sampled_from([np.float32, np.float64, np.uint32, np.int64, np.bool_]),
    hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
)


def archive_bytes() -> bytes:
    """Return an archive with members of several kinds and sizes."""
    rng = np.random.default_rng(3)
    contents: dict[str, Array] = {
        "noise": rng.random(40).astype(np.float32),
        "zeros": np.zeros((8, 8)),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a"
        write_archive(path, HEADER, contents)
        return path.read_bytes()


GOOD = archive_bytes()


@given(
    st.dictionaries(texts, json_values, max_size=3),
    st.dictionaries(st.sampled_from(["a", "b", "tiles"]), arrays, max_size=3),
)
def test_header_and_arrays_come_back_bit_for_bit(
    extra: dict[str, Any], contents: dict[str, Array]
) -> None:
    header = {**extra, **HEADER}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "archive"
        write_archive(path, header, contents)
        back, read = read_archive(path, FORMAT, 1)
    assert back == header
    assert read.keys() == contents.keys()
    for name, array in contents.items():
        assert (read[name].dtype, read[name].shape) == (array.dtype, array.shape)
        assert read[name].tobytes() == array.tobytes()


def test_numpy_alone_opens_an_archive(tmp_path: Path) -> None:
    write_archive(tmp_path / "a", HEADER, {"x": np.arange(3)})
    with np.load(tmp_path / "a", allow_pickle=False) as archive:
        npt.assert_array_equal(archive["x"], (0, 1, 2))
        assert json.loads(str(archive["header"])) == HEADER


def test_an_array_of_objects_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        write_archive(tmp_path / "a", HEADER, {"x": np.array([{}, None])})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, OSError])
def test_an_interrupted_write_leaves_the_older_file_and_nothing_else(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "map"
    path.write_bytes(b"the older map")

    def breaks_off(stream: IO[bytes]) -> None:
        stream.write(b"half of a new")
        stream.flush()
        raise error("pulled the plug")

    with pytest.raises(error, match="pulled the plug"):
        write_atomically(path, breaks_off)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"the older map"


def test_the_older_file_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "map"
    path.write_bytes(b"old")
    seen = []

    def write(stream: IO[bytes]) -> None:
        stream.write(b"new")
        stream.flush()
        seen.append(path.read_bytes())

    write_atomically(path, write)
    assert seen == [b"old"]
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_written_file_is_as_readable_as_any_other(tmp_path: Path) -> None:
    plain, ours = tmp_path / "plain", tmp_path / "ours"
    plain.write_bytes(b"")
    write_atomically(ours, lambda stream: stream.write(b""))
    assert ours.stat().st_mode == plain.stat().st_mode


def test_a_folder_is_not_replaced_and_nothing_is_left(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    folder.mkdir()
    with pytest.raises(IsADirectoryError, match="map"):
        write_atomically(folder, lambda stream: stream.write(b"x"))
    assert list(tmp_path.iterdir()) == [folder]


def test_a_missing_folder_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_archive(tmp_path / "nowhere" / "map", HEADER, {})


def pickled() -> bytes:
    return pickle.dumps({"format": FORMAT, "version": 1})


def one_array() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


def zip_of(**members: Any) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **members)
    return stream.getvalue()


def plain_zip() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("header.npy", "no array at all")
    return stream.getvalue()


NOT_ARCHIVES: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "text": lambda: b"a line of text\n" * 10,
    "noise": lambda: np.random.default_rng(1).bytes(500),
    "a pickle": pickled,
    "one array": one_array,
    "a zip of something": plain_zip,
    "arrays without a header": lambda: zip_of(x=np.zeros(3)),
    "a header that is no text": lambda: zip_of(header=np.zeros(3)),
    "a header that is no JSON": lambda: zip_of(header=np.array("{")),
    "a header that is a pickle": lambda: zip_of(header=np.array([{}], dtype=object)),
    "an array that is a pickle": lambda: zip_of(
        header=np.array(json.dumps(HEADER)), x=np.array([{}], dtype=object)
    ),
}


@pytest.mark.parametrize("what", NOT_ARCHIVES)
def test_a_file_that_is_not_an_archive_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / "file"
    path.write_bytes(NOT_ARCHIVES[what]())
    with pytest.raises(
        FileFormatError,
        match=f"expected a {FORMAT} file, got (something|another|a member|values of)",
    ):
        read_archive(path, FORMAT, 1)


@pytest.mark.parametrize("header", [{}, [], 5, "x", {**HEADER, "format": "other"}])
def test_an_archive_of_another_format_is_refused(tmp_path: Path, header: object) -> None:
    path = tmp_path / "file"
    path.write_bytes(zip_of(header=np.array(json.dumps(header))))
    with pytest.raises(FileFormatError, match=f"a {FORMAT} file, got another kind of archive"):
        read_archive(path, FORMAT, 1)


def test_a_newer_version_is_refused_with_what_to_do(tmp_path: Path) -> None:
    write_archive(tmp_path / "a", {**HEADER, "version": 3}, {})
    with pytest.raises(FileFormatError, match=r"version 2 or older, got version 3\. Upgrade"):
        read_archive(tmp_path / "a", FORMAT, 2)
    assert read_archive(tmp_path / "a", FORMAT, 3)[0]["version"] == 3


@pytest.mark.parametrize("version", ["1", None, [1], {}])
def test_a_version_that_is_not_a_number_is_refused(tmp_path: Path, version: object) -> None:
    write_archive(tmp_path / "a", {**HEADER, "version": version}, {})
    with pytest.raises(FileFormatError, match="version"):
        read_archive(tmp_path / "a", FORMAT, 1)


def test_a_missing_file_and_a_folder_are_distinguished(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no file of that name"):
        read_archive(tmp_path / "nowhere", FORMAT, 1)
    with pytest.raises(FileFormatError, match="a folder"):
        read_archive(tmp_path, FORMAT, 1)


@given(st.integers(0, len(GOOD) - 1))
def test_a_truncated_archive_is_refused(length: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "archive"
        path.write_bytes(GOOD[:length])
        with pytest.raises(FileFormatError, match="something else"):
            read_archive(path, FORMAT, 1)


def place_of(marker: bytes, offset: int) -> int:
    return GOOD.index(marker) + offset


@given(st.integers(0, len(GOOD) - 1), st.integers(0, 7))
@example(place_of(b"header.npy", 12), 0)  # inside deflated data
@example(place_of(b"PK\x01\x02", 10), 0)  # compression method
@example(place_of(b"PK\x01\x02", 8), 0)  # "encrypted"
def test_an_archive_with_a_wrong_bit_is_refused_or_reads_the_same(place: int, bit: int) -> None:
    damaged = bytearray(GOOD)
    damaged[place] ^= 1 << bit
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "archive"
        path.write_bytes(GOOD)
        header, contents = read_archive(path, FORMAT, 1)
        path.write_bytes(damaged)
        try:
            back, read = read_archive(path, FORMAT, 1)
        except FileFormatError:
            return
    assert back == header
    for name in read.keys() & contents.keys():
        npt.assert_array_equal(read[name], contents[name])


NOWHERE = [
    ("gone/x.npz", "a file in a folder that exists, got no folder"),
    ("folder", "a file name, got a folder"),
    ("x" * 300, "a file that can be written, got file name too long"),
    ("a\0b", "a file that can be written, got an invalid file name"),
    ("circle", "a file that can be written, got"),
]


@pytest.mark.parametrize(("name", "got"), NOWHERE, ids=["gone", "folder", "long", "NUL", "circle"])
def test_a_path_that_cannot_be_written_is_refused(tmp_path: Path, name: str, got: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "circle").symlink_to(tmp_path / "circle" / "x")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(FileFormatError, match=f"expected {got}"):
        check_writable(tmp_path / name)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder that root can't write to")
def test_a_folder_that_cannot_be_written_to_is_refused() -> None:
    with pytest.raises(FileFormatError, match="expected a file that can be written, got"):
        check_writable("/proc/map.npz")


def test_a_name_of_the_maximum_length_is_written(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 255)
    check_writable(path)
    write_archive(path, HEADER, {})
    assert [entry.name for entry in tmp_path.iterdir()] == ["x" * 255]
