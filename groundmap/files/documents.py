"""TOML, YAML and JSON files of any origin, read as plain values of bounded size and depth.

The values are dictionaries with text keys, lists, text, truth values, None and numbers. Whole
numbers have at most 64 bits, and text has no characters that file names cannot have.
"""

from __future__ import annotations

import json
import re
import tomllib
from os import PathLike
from typing import Any

import yaml

from groundmap.errors import FileFormatError
from groundmap.files.opening import read_file
from groundmap.printable import is_plain

MOST_BYTES = {"TOML": 2**20, "YAML": 2**16, "JSON": 2**24}
MOST_VALUES = {"TOML": 10**6, "YAML": 10**5, "JSON": 10**7}  # aliases in YAML count in full
DEEPEST = 64  # levels of nesting
MOST_PARTS = 32  # of a dotted key; the time of tomllib grows with the cube of their number
DOTTED_KEY = re.compile(rf"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


class WrongDocumentError(ValueError):
    """A text that is not a valid document; the message describes what it is instead."""

    def __init__(self, got: str, *, line: int | None = None) -> None:
        super().__init__(got)
        self.line = line


def read_toml(path: str | PathLike[str], expected: str = "a TOML file") -> dict[str, Any]:
    """Return the content of a TOML file; the module describes the possible values.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The file is missing, too large or not TOML, is nested too deeply, or has a value of another
        kind.
    """
    text = _text(path, "TOML", expected)
    try:
        if DOTTED_KEY.search(text):
            raise WrongDocumentError(f"a key of more than {MOST_PARTS} parts")
        content = _parse_text(tomllib.loads, text)
        check_values(content, MOST_VALUES["TOML"])
    except WrongDocumentError as error:
        raise FileFormatError(path, "a TOML file", str(error), line=error.line) from error
    assert isinstance(content, dict)
    return content


def read_yaml(path: str | PathLike[str], expected: str = "a YAML file") -> Any:
    """Return the content of a YAML file, with all scalars as text.

    The caller converts scalars to numbers, as with YAML libraries for C++; tags are ignored.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The file is missing, too large or not YAML, or is nested too deeply.
    """
    text = _text(path, "YAML", expected)
    try:
        content = _parse_text(_load_yaml, text)
        check_values(content, MOST_VALUES["YAML"])
    except WrongDocumentError as error:
        raise FileFormatError(path, "YAML", str(error), line=error.line) from error
    return content


def read_json(
    path: str | PathLike[str],
    expected: str = "a JSON file",
    *,
    most: int = MOST_BYTES["JSON"],
) -> Any:
    """Return the content of a JSON file; the module describes the possible values.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.
    most : int, default 2**24
        Largest size [bytes]; a value has at least two.

    Raises
    ------
    FileFormatError
        The file is missing, too large or not JSON, or is nested too deeply.
    """
    text = _text(path, "JSON", expected, most=most)
    try:
        return parse_json(text, most_values=max(MOST_VALUES["JSON"], most // 2))
    except WrongDocumentError as error:
        raise FileFormatError(path, "JSON", str(error), line=error.line) from error


def parse_json(text: str, *, most_values: int = MOST_VALUES["JSON"]) -> Any:
    """Return the content of a JSON text; the module describes the possible values.

    Parameters
    ----------
    text : str
    most_values : int, default 10**7

    Raises
    ------
    WrongDocumentError
        The text is not JSON, is nested too deeply, or has a value of another kind.

    Examples
    --------
    >>> parse_json('{"origin": [0, 2.5]}')
    {'origin': [0, 2.5]}
    """
    content = _parse_text(json.loads, text)
    check_values(content, most_values)
    return content


def _text(path: str | PathLike[str], kind: str, expected: str, *, most: int | None = None) -> str:
    content = read_file(path, expected, most=most or MOST_BYTES[kind])
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise FileFormatError(path, f"{kind} in UTF-8", "another encoding", line=line) from error


def _load_yaml(text: str) -> Any:
    return yaml.load(text, Loader=yaml.BaseLoader)  # text, lists and mappings only


def _parse_text(parse: Any, text: str) -> Any:
    try:
        return parse(text)
    except RecursionError as error:
        raise WrongDocumentError(f"more than {DEEPEST} levels of nesting") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = getattr(error, "problem", None)
        raise WrongDocumentError(
            f"something else ({problem})" if problem else "something else", line=line
        ) from error
    except json.JSONDecodeError as error:
        raise WrongDocumentError(f"something else ({error.msg})", line=error.lineno) from error
    except ValueError as error:  # faults in TOML, nonexistent dates, numbers with many digits
        raise WrongDocumentError(f"something else ({error})") from error


def check_values(content: Any, most: int) -> None:
    """Check every value of a document, without recursion.

    Parameters
    ----------
    content : object
    most : int
        Largest number of values.

    Raises
    ------
    WrongDocumentError
        More values, more than 64 levels of nesting, or a value of another kind.
    """
    pending: list[tuple[Any, int]] = [(content, 0)]
    count = 0
    while pending:
        value, depth = pending.pop()
        count += 1
        if count > most:
            raise WrongDocumentError(f"more than {most} values")
        if isinstance(value, dict):
            parts: list[Any] = [*value, *value.values()]
        elif isinstance(value, list):
            parts = value
        else:
            _check_scalar(value)
            continue
        if depth == DEEPEST:
            raise WrongDocumentError(f"more than {DEEPEST} levels of nesting")
        pending.extend((part, depth + 1) for part in parts)


def _check_scalar(value: Any) -> None:
    if isinstance(value, bool | float) or value is None:
        return
    if isinstance(value, int):
        if not -(2**63) <= value < 2**63:
            raise WrongDocumentError("a whole number of more than 64 bits")
    elif isinstance(value, str):
        if not is_plain(value):
            raise WrongDocumentError("text with NUL or an unpaired surrogate")
    else:
        raise WrongDocumentError(f"a {type(value).__name__}")
