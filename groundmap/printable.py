"""Text that is safe to print: without control characters, and of a bounded length."""

from __future__ import annotations

import re
import sys

MOST_OF_A_VALUE = 300  # characters of a value or a file name in a message
MOST_OF_A_SENTENCE = 3000  # characters; the longest lists of names have about 1,500
ELLIPSIS = "..."
UNSTORABLE = re.compile("[\0\ud800-\udfff]")


def printable(text: str, *, most: int = MOST_OF_A_SENTENCE, lines: bool = False) -> str:
    r"""Return a text with unprintable characters escaped, cut in the middle if it is too long.

    Control and format characters (such as bidirectional marks), unpaired surrogates and all
    separators except the space are unprintable.

    Parameters
    ----------
    text : str
    most : int, default 3000
        Largest length of the result [characters].
    lines : bool, default False
        Whether line feeds are kept.

    Examples
    --------
    >>> print(printable("red: \x1b[31m, reversed: \u202e, a byte of a file's name: \udcff"))
    red: \x1b[31m, reversed: \u202e, a byte of a file's name: \udcff
    >>> printable("abcdefghijklmnop", most=9)
    'abc...nop'
    """
    # Cut first, so that the time does not depend on the length of the text.
    marks = _cut(text, most)
    kept = "\n" if lines else ""
    escaped = (
        mark if mark.isprintable() or mark in kept else mark.encode("unicode_escape").decode()
        for mark in marks
    )
    return _cut("".join(escaped), most)


def format_value(value: object, *, most: int = MOST_OF_A_VALUE) -> str:
    r"""Return the repr of a value, printable and cut in the middle if it is too long.

    Parameters
    ----------
    value : object
    most : int, default 300
        Largest length of the result [characters].

    Examples
    --------
    >>> print(format_value("one\ttwo"))
    'one\ttwo'
    >>> format_value(10**5000)
    'a number of more than 4300 digits'
    >>> format_value(list(range(1000)), most=21)
    '[0, 1, 2,...998, 999]'
    """
    try:
        text = repr(value)
    except ValueError:  # the limit of Python
        return f"a number of more than {sys.get_int_max_str_digits()} digits"
    except RecursionError:
        return f"a deeply nested {type(value).__name__}"
    return printable(text, most=most)


def is_plain(text: str) -> bool:
    """Return whether a text is without NUL and unpaired surrogates, and can be stored in files."""
    return not UNSTORABLE.search(text)


def _cut(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    tail = (most - len(ELLIPSIS)) // 2
    head = most - len(ELLIPSIS) - tail
    return text[:head] + ELLIPSIS + text[-tail:]
