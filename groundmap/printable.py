"""Text that is safe to print: no control characters, and of a bounded length."""

from __future__ import annotations

import re
import sys

MOST_OF_A_VALUE = 300  # characters of a value, or of a file's name, in a sentence
MOST_OF_A_SENTENCE = 3000  # characters; the longest lists of names have some 1,500
ELLIPSIS = "..."
UNSTORABLE = re.compile("[\0\ud800-\udfff]")


def printable(text: str, *, most: int = MOST_OF_A_SENTENCE, lines: bool = False) -> str:
    r"""Return a text with its unprintable characters escaped, cut in the middle if too long.

    Unprintable are control and format characters (bidirectional marks among them), unpaired
    surrogates, and all separators but the space.

    Parameters
    ----------
    text : str
    most : int, default 3000
        Characters of the result, at most.
    lines : bool, default False
        Whether line feeds are kept.

    Examples
    --------
    >>> print(printable("red: \x1b[31m, reversed: \u202e, a byte of a file's name: \udcff"))
    red: \x1b[31m, reversed: \u202e, a byte of a file's name: \udcff
    >>> printable("abcdefghijklmnop", most=9)
    'abc...nop'
    """
    # Cut before as well, so that the time does not depend on the text.
    marks = _cut(text, most)
    kept = "\n" if lines else ""
    escaped = (
        mark if mark.isprintable() or mark in kept else mark.encode("unicode_escape").decode()
        for mark in marks
    )
    return _cut("".join(escaped), most)


def format_value(value: object, *, most: int = MOST_OF_A_VALUE) -> str:
    r"""Return a value as Python writes it, printable and cut in the middle if too long.

    Examples
    --------
    >>> print(format_value("one\ttwo"), format_value(10**5000), format_value(list(range(1000)),
    most=21), sep="; ") 'one\ttwo'; a number of more than 4300 digits; [0, 1, 2,...998, 999]
    """
    try:
        text = repr(value)
    except ValueError:  # Python's own limit
        return f"a number of more than {sys.get_int_max_str_digits()} digits"
    except RecursionError:
        return f"a deeply nested {type(value).__name__}"
    return printable(text, most=most)


def is_plain(text: str) -> bool:
    """Whether a text can be stored anywhere: without NUL and unpaired surrogates."""
    return not UNSTORABLE.search(text)


def _cut(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    tail = (most - len(ELLIPSIS)) // 2
    head = most - len(ELLIPSIS) - tail
    return text[:head] + ELLIPSIS + text[-tail:]
