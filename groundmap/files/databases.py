"""SQLite databases of any origin, opened for reading only, with limits."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any
from urllib.parse import quote

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file

MAGIC = b"SQLite format 3\0"
MOST_OF_A_VALUE = 2**28  # bytes of a text or blob
MOST_SECONDS = 300.0
STEPS = 100_000  # of SQLite's machine between two looks at the clock
# Reading of tables is allowed, and nothing else.
ALLOWED = {
    sqlite3.SQLITE_SELECT,
    sqlite3.SQLITE_READ,
    sqlite3.SQLITE_FUNCTION,
    sqlite3.SQLITE_PRAGMA,
}
FUNCTIONS = {"length", "count", "abs", "min", "max"}
PRAGMAS = {"table_info", "trusted_schema", "cell_size_check", "query_only"}


class Database:
    """A database that is open for reading.

    Parameters
    ----------
    path : path
    connection : Connection
    expected : str
        Kind of file that is expected, for error messages.
    """

    def __init__(
        self, path: str | PathLike[str], connection: sqlite3.Connection, expected: str
    ) -> None:
        self.path, self.expected = path, expected
        self._connection = connection

    def tables(self) -> dict[str, list[str]]:
        """Return the columns of each table; views are left out, as they may run other code."""
        names = self.rows("SELECT name FROM sqlite_master WHERE type = 'table'")
        tables = {}
        for (name,) in names:
            if isinstance(name, str) and name.isidentifier():
                columns = self.rows(f'PRAGMA table_info("{name}")')
                tables[name] = [str(column[1]) for column in columns]
        return tables

    def rows(self, query: str, parameters: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query.

        Parameters
        ----------
        query : str
        parameters : tuple, optional

        Raises
        ------
        FileFormatError
            The database is damaged or locked, or the query exceeds a limit.
        """
        try:
            yield from self._connection.execute(query, parameters)
        except (sqlite3.Error, OverflowError, UnicodeDecodeError, MemoryError) as error:
            raise self._error(error) from error

    def _error(self, error: Exception) -> FileFormatError:
        text = str(error) or type(error).__name__
        hint = ""
        if "locked" in text or "busy" in text:
            hint = "Another program uses it: close that, or copy the file."
        return FileFormatError(self.path, self.expected, f"a damaged one ({text})", hint=hint)


def has_tables(path: str | PathLike[str], tables: set[str]) -> bool:
    """Return whether a file is a database with certain tables.

    Parameters
    ----------
    path : path
    tables : set of str

    Raises
    ------
    FileFormatError
        The database is locked, so that its tables cannot be read.
    """
    try:
        with open_database(path, "a database that can be read") as database:
            return set(database.tables()) >= tables
    except FileFormatError as error:
        if error.hint:
            raise
        return False


@contextmanager
def open_database(path: str | PathLike[str], expected: str) -> Iterator[Database]:
    """Open a database for reading; its file is never changed.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The file is missing, no database, damaged or locked.
    """
    with open_file(path, expected) as stream:
        head = stream.read(len(MAGIC))
    if head != MAGIC:
        raise FileFormatError(path, expected, "a file that is no SQLite database")
    name = quote(str(Path(path).absolute()))
    try:
        connection = sqlite3.connect(f"file:{name}?mode=ro", uri=True, timeout=2.0)
    except sqlite3.Error as error:
        raise FileFormatError(path, expected, f"a file that does not open ({error})") from error
    try:
        _limit(connection)
        yield Database(path, connection, expected)
    finally:
        connection.close()


def _limit(connection: sqlite3.Connection) -> None:
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_OF_A_VALUE)
    connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    connection.setlimit(sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 0)
    connection.text_factory = lambda text: text.decode("utf-8", "replace")
    connection.set_authorizer(_authorise)
    end = time.monotonic() + MOST_SECONDS
    connection.set_progress_handler(lambda: time.monotonic() > end, STEPS)


def _authorise(
    action: int, first: str | None, second: str | None, database: str | None, inner: str | None
) -> int:
    allowed = action in ALLOWED and inner is None
    if action == sqlite3.SQLITE_FUNCTION:
        allowed = allowed and second in FUNCTIONS
    if action == sqlite3.SQLITE_PRAGMA:
        allowed = allowed and first in PRAGMAS
    return sqlite3.SQLITE_OK if allowed else sqlite3.SQLITE_DENY
