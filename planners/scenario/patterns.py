"""Regular expressions of scenario files, searched for with bounds on size and time."""

from __future__ import annotations

import re
import subprocess
import sys
import warnings
from functools import cache

from groundmap.errors import InputError
from groundmap.printable import format_value

MOST_CHARACTERS = 500
TIME_LIMIT = 5.0  # [s] of a search
PLAIN = re.compile(r"[^\\.^$*+?{}\[\]|()]*")
# A search in this process can't be interrupted, and some patterns take exponential time. The alarm
# ends the child process if its parent was killed.
SEARCH = """
import re, signal, sys
getattr(signal, "alarm", abs)(10)
sys.exit(0 if re.search(sys.argv[1], sys.argv[2]) else 1)
"""


def check_pattern(name: str, pattern: str) -> None:
    """Check that a pattern is a regular expression.

    Parameters
    ----------
    name : str
        Name of the setting, for the message.
    pattern : str

    Raises
    ------
    InputError
        The pattern is no regular expression, or has more than 500 characters.
    """
    if len(pattern) > MOST_CHARACTERS:
        raise InputError(name, f"{MOST_CHARACTERS} characters at most", str(len(pattern)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # FutureWarning of syntax that can change its meaning
            re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(name, f"a regular expression ({error})", format_value(pattern)) from error


@cache
def is_found(pattern: str, text: str) -> bool:
    r"""Return whether a pattern matches somewhere in a text; False after 5 s.

    Parameters
    ----------
    pattern : str
    text : str

    Examples
    --------
    >>> is_found("enclosed", "the goal is enclosed"), is_found(r"\d m", "3 km")
    (True, False)
    """
    if PLAIN.fullmatch(pattern):
        return pattern in text
    search = [sys.executable, "-I", "-S", "-W", "ignore", "-c", SEARCH, pattern, text]
    try:
        return subprocess.run(search, check=False, timeout=TIME_LIMIT).returncode == 0
    except subprocess.TimeoutExpired:
        return False
