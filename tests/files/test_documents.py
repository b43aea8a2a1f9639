"""Documents of any origin: values of bounded size, or one error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from groundmap.errors import FileFormatError
from groundmap.files.documents import (
    DEEPEST,
    WrongDocumentError,
    parse_json,
    read_json,
    read_toml,
    read_yaml,
)

Reader = Callable[[Path], Any]
DOUBLED = "".join(f"b{i + 1}: &b{i + 1} [*b{i}, *b{i}]\n" for i in range(40))


def document(folder: Path, content: str | bytes) -> Path:
    path = folder / "document"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    ("read", "content", "got"),
    [
        (read_toml, "a = " + "1" * 5000, r"got something else \(Exceeds the limit"),
        (read_toml, "a = 0x" + "f" * 5000, "got a whole number of more than 64 bits"),
        (read_toml, "a = " + "[" * 5000 + "]" * 5000, "got more than 64 levels of nesting"),
        (read_toml, "a." * 200_000 + "b = 1", "got a key of more than 32 parts"),
        (read_toml, "a = 2020-12-01", "got a date"),
        (read_toml, "a = 2020-13-01", "got something else"),
        (read_toml, 'a = "\\u0000"', "got text with NUL"),
        (read_toml, b"a = 'b'\nc = '\xff'", "TOML in UTF-8, got another encoding at line 2"),
        (read_toml, "#" * (2**20 + 1), "of at most 1048576 bytes, got a larger file"),
        (read_yaml, "[" * 5000, "got more than 64 levels of nesting"),
        (read_yaml, "- " * 5000, "got more than 64 levels of nesting"),
        (read_yaml, "a: &a [*a]", r"got something else \(.*recursive.*\) at line 1"),
        (read_yaml, "b0: &b0 [1]\n" + DOUBLED, "got more than 100000 values"),
        (read_yaml, 'a: "\\ud800"', "got text with NUL or an unpaired surrogate"),
        (read_yaml, "#" * (2**16 + 1), "of at most 65536 bytes, got a larger file"),
        (read_json, "[" * 100_000, "got more than 64 levels of nesting"),
        (read_json, "1" * 5000, r"got something else \(Exceeds the limit"),
        (read_json, "1" * 4000, "got a whole number of more than 64 bits"),
        (read_json, '"\\ud800"', "got text with NUL or an unpaired surrogate"),
        (read_json, "[1,\n2", r"got something else \(.*\) at line 2"),
    ],
)
def test_invalid_documents_are_refused(
    tmp_path: Path, read: Reader, content: str | bytes, got: str
) -> None:
    with pytest.raises(FileFormatError, match=rf"document: expected .*{got}"):
        read(document(tmp_path, content))


NAMES = {
    "a\0b": "an invalid file name",
    "\ud800": "an invalid file name",
    "x" * 300: "file name too long",
    "gone": "no file of that name",
    ".": "a folder",
}


@pytest.mark.parametrize("read", [read_toml, read_yaml, read_json])
@pytest.mark.parametrize("name", NAMES)
def test_a_path_that_cannot_be_read_is_refused(tmp_path: Path, read: Reader, name: str) -> None:
    with pytest.raises(FileFormatError, match=f"expected a .* file, got {NAMES[name]}"):
        read(tmp_path / name)


@pytest.mark.parametrize("read", [read_yaml, read_json])
def test_the_deepest_nesting_that_is_allowed_is_read(tmp_path: Path, read: Reader) -> None:
    content = read(document(tmp_path, "[" * DEEPEST + "]" * DEEPEST))
    for _ in range(DEEPEST - 1):
        [content] = content
    assert content == []


def test_scalars_of_yaml_are_text(tmp_path: Path) -> None:
    text = f"date: 2020-13-01\nlong: {'1' * 5000}\nyes: no\nnone:\n"
    assert read_yaml(document(tmp_path, text)) == {
        "date": "2020-13-01",
        "long": "1" * 5000,
        "yes": "no",
        "none": "",
    }


def test_the_largest_whole_numbers_of_64_bits_are_read(tmp_path: Path) -> None:
    assert parse_json(f"[{2**63 - 1}, {-(2**63)}]") == [2**63 - 1, -(2**63)]
    with pytest.raises(WrongDocumentError, match="more than 64 bits"):
        parse_json(str(2**63))


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    assert read_toml(document(tmp_path, b"\xef\xbb\xbfa = 1")) == {"a": 1}
