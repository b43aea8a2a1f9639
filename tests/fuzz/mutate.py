"""Damage to files: to their bytes, their lines, their words and their numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

from fuzz.draw import Draw

NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
NUMBERS: tuple[bytes, ...] = (
    b"nan", b"inf", b"-inf", b"+nan", b"0", b"-0", b"-1", b"1", b"2", b"255", b"256", b"65536",
    b"1e400", b"-1e400", b"1e-400", b"1e308", b"1e155", b"1e30", b"1e18", b"1e9", b"1e-9",
    b"2147483647", b"2147483648", b"4294967296", b"9223372036854775807", b"9223372036854775808",
    b"-9223372036854775809", b"18446744073709551616", b"0x10", b"0o7", b"0b1", b"1_000", b"1.",
    b".5", b"1e5", b"1,5", b"1.5.5", b"--1", b"1j", b"true", b"null", b"~", b"", b"''", b"'1'",
    b"9" * 5000, b"1" + b"0" * 400, b"0." + b"3" * 5000, b"1e" + b"9" * 30, b"1979-05-27",
    b"2001-13-45", b"2001-12-14t21:59:43.10-05:00", b"07:32:00", b"1:30", b"\xd9\xa3",
    b"\xe2\x91\xa0",
    b"\xc2\xb2", b"1\x00", b"[1]", b"{}", b"[[[]]]",
)  # fmt: skip
WORDS: tuple[bytes, ...] = (
    b"", b" ", b"\t", b"#", b'"', b"'", b"=", b":", b",", b"[", b"]", b"{", b"}", b"\\", b"/",
    b"..",
    b"\n", b"\r", b"\r\n", b"\x00", b"\x1b[2J", b"\x0c", b"\x85", b"\xe2\x80\xa8", b"\xe2\x80\xae",
    b"\xef\xbb\xbf", b"\xff\xfe", b"\xed\xa0\x80", b"\xff", b"\xc3", b"\xf0\x9f\x9a\x97",
    b"[" * 2000,
    b"{a: " * 1000, b"[" * 50_000, b"a." * 2000, b"&a", b"*a", b"<<: *a",
    b"!!python/object:os.system",
    b"!!binary x", b"!!timestamp 1", b"!!float x", b"!!int ''", b"!!set {a}", b"? a", b"---",
    b"...",
    b"%YAML 9.9", b'"\\ud800"', b'"\\U00110000"', b'"\\u0000"', b'"\\u202e"', b"a" * 300,
    b"a" * 70_000,
    b"map.png", b"/dev/zero", b"/", b".", b"x/" * 3000, b"map", b"version 1", b"(a+)+$",
)  # fmt: skip


def damaged(data: bytes, draw: Draw) -> bytes:
    """Return the bytes of a file after one to four kinds of damage."""
    for _ in range(draw.pick((1, 1, 1, 2, 2, 3, 4))):
        data = draw.pick(DAMAGES)(data, draw)
    return data


def damaged_bytes(data: bytes, draw: Draw) -> bytes:
    """Return the bytes of a binary file, damaged without regard to what they mean."""
    for _ in range(draw.pick((1, 1, 2, 4))):
        data = draw.pick(BYTE_DAMAGES)(data, draw)
    return data


def _number(data: bytes, draw: Draw) -> bytes:
    """Replace one number."""
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    match = draw.pick(found)
    return data[: match.start()] + draw.pick(NUMBERS) + data[match.end() :]


def _sign_or_scale(data: bytes, draw: Draw) -> bytes:
    """Change the sign or the size of one number."""
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    match = draw.pick(found)
    before, ending = draw.pick(((b"-", b""), (b"", b"0"), (b"", b"000000"), (b"0.000", b"")))
    text = before + match.group().lstrip(b"-+") + ending
    return data[: match.start()] + text + data[match.end() :]


def _word(data: bytes, draw: Draw) -> bytes:
    """Insert a word somewhere, or replace one by it."""
    at = draw.whole(0, len(data))
    cut = draw.pick((0, 0, 1, 4))
    return data[:at] + draw.pick(WORDS) + data[at + cut :]


def _value(data: bytes, draw: Draw) -> bytes:
    """Replace what follows a sign of equality or a colon in one line."""
    found = list(re.finditer(rb"(?m)^(\s*[\w.\"]+\s*[=:] ?)(.*)$", data))
    if not found:
        return _number(data, draw)
    match = draw.pick(found)
    value = draw.pick(draw.pick((NUMBERS, WORDS)))
    return data[: match.start(2)] + value + data[match.end(2) :]


def _lines(data: bytes, draw: Draw) -> bytes:
    """Drop, repeat, exchange or move whole lines."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    a, b = draw.whole(0, len(lines) - 1), draw.whole(0, len(lines) - 1)
    change = draw.whole(0, 4)
    if change == 0:
        del lines[a]
    elif change == 1:
        lines.insert(b, lines[a])
    elif change == 2:
        lines[a], lines[b] = lines[b], lines[a]
    elif change == 3:
        lines[a:b] = []
    else:
        lines[a:a] = [lines[a]] * draw.pick((2, 10, 300))
    return b"".join(lines)


def _columns(data: bytes, draw: Draw) -> bytes:
    """Drop, repeat or join words of one line."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    row = draw.whole(0, len(lines) - 1)
    mark = b"," if b"," in lines[row] else b" "
    words = lines[row].rstrip(b"\n").split(mark)
    place = draw.whole(0, len(words) - 1)
    change = draw.whole(0, 2)
    if change == 0:
        del words[place]
    elif change == 1:
        words.insert(place, draw.pick(words))
    else:
        mark = draw.pick((b",", b", ", b"\t", b";", b"  ", b""))
    lines[row] = mark.join(words) + b"\n"
    return b"".join(lines)


def _cut(data: bytes, draw: Draw) -> bytes:
    """End the file early."""
    return data[: draw.whole(0, len(data))]


def _bits(data: bytes, draw: Draw) -> bytes:
    """Change single bytes."""
    changed = bytearray(data)
    for _ in range(draw.pick((1, 1, 2, 8))):
        if changed:
            changed[draw.whole(0, len(changed) - 1)] = draw.whole(0, 255)
    return bytes(changed)


def _hole(data: bytes, draw: Draw) -> bytes:
    """Take a piece out, or put it in twice."""
    a, b = sorted((draw.whole(0, len(data)), draw.whole(0, len(data))))
    return data[:a] + data[b:] if draw.chance(0.5) else data[:b] + data[a:]


def _ends(data: bytes, draw: Draw) -> bytes:
    """Write the line ends, or the whole text, another way."""
    change = draw.whole(0, 4)
    if change == 0:
        return data.replace(b"\n", draw.pick((b"\r\n", b"\r", b"\n\n", b" \n")))
    if change == 1:
        return b"\xef\xbb\xbf" + data
    encoding = ("utf-16", "utf-32", "utf-7")[change - 2]
    encoded: bytes = data.decode("utf-8", "replace").encode(encoding, "replace")
    return encoded


def _words_of_size(data: bytes, draw: Draw) -> bytes:
    """Write one whole number of a binary file anew, in 16 or 32 bits."""
    size = draw.pick((2, 4))
    if len(data) < size:
        return data
    at = draw.whole(0, len(data) - size)
    value: int = draw.pick((0, 1, 2**15, 2**16 - 1, 2**31, 2**32 - 1)) % 2 ** (8 * size)
    orders: tuple[Literal["little", "big"], ...] = ("little", "big")
    return data[:at] + value.to_bytes(size, draw.pick(orders)) + data[at + size :]


Damage = Callable[[bytes, Draw], bytes]
DAMAGES: tuple[Damage, ...] = (
    _number, _number, _number, _sign_or_scale, _sign_or_scale, _word, _word, _value, _value,
    _lines, _lines, _columns, _columns, _cut, _bits, _hole, _ends,
)  # fmt: skip
BYTE_DAMAGES: tuple[Damage, ...] = (_bits, _bits, _cut, _hole, _words_of_size, _words_of_size)
