"""TOML, YAML and JSON that others wrote, as plain values of bounded size and depth.

What these functions return holds nothing but dictionaries with text for keys, lists, text, truth
values, None and numbers; whole numbers have at most 64 bits, and text can be part of a file's name.
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
MOST_VALUES = {"TOML": 10**6, "YAML": 10**5, "JSON": 10**7}  # an alias counts as what it stands for
DEEPEST = 64  # levels of nesting
MOST_PARTS = 32  # of a dotted key: the time that tomllib takes grows with the cube of their number
DOTTED_KEY = re.compile(rf"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


class WrongDocumentError(ValueError):
    """A text that is no such document; the message says what it is instead."""

    def __init__(self, got: str, *, line: int | None = None) -> None:
        super().__init__(got)
        self.line = line


def read_toml(path: str | PathLike[str], expected: str = "a TOML file") -> dict[str, Any]:
    """Return the content of a TOML file; see the module for what it can hold.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for the error.

    Raises
    ------
    FileFormatError
        A file that is missing, too large, or no TOML; too deep; a value of another kind.
    """
    text = _text(path, "TOML", expected)
    try:
        if DOTTED_KEY.search(text):
            raise WrongDocumentError(f"a key of more than {MOST_PARTS} parts")
        content = _parse_text(tomllib.loads, text)
        _check(content, "TOML")
    except WrongDocumentError as error:
        raise FileFormatError(path, "a TOML file", str(error), line=error.line) from error
    assert isinstance(content, dict)
    return content


def read_yaml(path: str | PathLike[str], expected: str = "a YAML file") -> Any:
    """Return the content of a YAML file, its scalars as the text that stands there.

    Text only, as libraries for C++ have it: what a scalar means is for its reader to say, and
    tags and the many forms of numbers and dates are no concern of this function.

    Raises
    ------
    FileFormatError
        As of `read_toml`.
    """
    text = _text(path, "YAML", expected)
    try:
        content = _parse_text(_load_yaml, text)
        _check(content, "YAML")
    except WrongDocumentError as error:
        raise FileFormatError(path, "YAML", str(error), line=error.line) from error
    return content


def read_json(path: str | PathLike[str], expected: str = "a JSON file") -> Any:
    """Return the content of a JSON file; see the module for what it can hold.

    Raises
    ------
    FileFormatError
        As of `read_toml`.
    """
    text = _text(path, "JSON", expected)
    try:
        return parse_json(text)
    except WrongDocumentError as error:
        raise FileFormatError(path, "JSON", str(error), line=error.line) from error


def parse_json(text: str) -> Any:
    """Return what a text says in JSON; see the module for what it can hold.

    Raises
    ------
    WrongDocumentError
        No JSON; too deep; a value of another kind.

    Examples
    --------
    >>> parse_json('{"origin": [0, 2.5]}')
    {'origin': [0, 2.5]}
    """
    content = _parse_text(json.loads, text)
    _check(content, "JSON")
    return content


def _text(path: str | PathLike[str], kind: str, expected: str) -> str:
    content = read_file(path, expected, most=MOST_BYTES[kind])
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
        raise WrongDocumentError(f"more than {DEEPEST} levels") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = getattr(error, "problem", None)
        raise WrongDocumentError(
            f"something else ({problem})" if problem else "something else", line=line
        ) from error
    except json.JSONDecodeError as error:
        raise WrongDocumentError(f"something else ({error.msg})", line=error.lineno) from error
    except ValueError as error:  # tomllib's own, dates that don't exist, numbers of many digits
        raise WrongDocumentError(f"something else ({error})") from error


def _check(content: Any, kind: str) -> None:
    """Check every value, without recursion."""
    left: list[tuple[Any, int]] = [(content, 0)]
    count = 0
    while left:
        value, depth = left.pop()
        count += 1
        if count > MOST_VALUES[kind]:
            raise WrongDocumentError(f"more than {MOST_VALUES[kind]} values")
        if isinstance(value, dict):
            inside: list[Any] = [*value, *value.values()]
        elif isinstance(value, list):
            inside = value
        else:
            _check_scalar(value)
            continue
        if depth == DEEPEST:
            raise WrongDocumentError(f"more than {DEEPEST} levels")
        left.extend((part, depth + 1) for part in inside)


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
