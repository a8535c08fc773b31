"""Files that are changed at random: the same for the same seed and number, on every machine."""

from __future__ import annotations

import random
from collections.abc import Callable

STRANGE = (
    b"1e400", b"-1e400", b"nan", b"inf", b"-0.0", b"9" * 5000, b"1" + b"0" * 400, b"0x7fffffffffffffff", b"true", b'""',
    b"[]", b"{}", b"[[]]", b"1979-05-27", b"'", b'"', b'"""', b"\x00", b"\xff\xfe", "\u2028°é".encode(), b"\r", b"=",
    b"..", b"[", b"]]", b"{", b"#", b",", b";", b"\t", b"../../etc/passwd", b"%s%n", b"$HOME", b"__import__('os')",
)  # fmt: skip
LARGE = 10_000_000


def _place(r: random.Random, data: bytes) -> int:
    return r.randrange(len(data) + 1)


def flip(r: random.Random, data: bytes) -> bytes:
    """One bit."""
    at = r.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << r.randrange(8))]) + data[at + 1 :]


def cut(r: random.Random, data: bytes) -> bytes:
    """A stretch is missing."""
    at = _place(r, data)
    return data[:at] + data[at + r.randrange(1, 1 + max(len(data) // 4, 1)) :]


def truncate(r: random.Random, data: bytes) -> bytes:
    return data[: _place(r, data)]


def repeat(r: random.Random, data: bytes) -> bytes:
    """A stretch is there twice."""
    at = _place(r, data)
    end = at + r.randrange(1, 200)
    return data[:end] + data[at:end] + data[end:]


def noise(r: random.Random, data: bytes) -> bytes:
    at = _place(r, data)
    return data[:at] + r.randbytes(r.randrange(1, 20)) + data[at + r.randrange(20) :]


def strange(r: random.Random, data: bytes) -> bytes:
    """A word of its own is put somewhere."""
    at = _place(r, data)
    return data[:at] + r.choice(STRANGE) + data[at:]


def lines(r: random.Random, data: bytes) -> bytes:
    """Two lines change places, or one is there twice, or is missing."""
    rows = data.split(b"\n")
    one, other = r.randrange(len(rows)), r.randrange(len(rows))
    rows[one], rows[other] = r.choice([(rows[other], rows[one]), (rows[other], rows[other]), (b"", rows[other])])
    return b"\n".join(rows)


def value(r: random.Random, data: bytes) -> bytes:
    """What stands behind an equals sign, or between two commas, is another word."""
    mark = b"=" if b"=" in data else b","
    parts = data.split(mark)
    if len(parts) < 2:
        return data
    which = r.randrange(1, len(parts))
    end = min((at for at in (parts[which].find(b"\n"), parts[which].find(b",")) if at >= 0), default=len(parts[which]))
    parts[which] = b" " + r.choice(STRANGE) + parts[which][end:]
    return mark.join(parts)


def marked(r: random.Random, data: bytes) -> bytes:
    """A byte order mark before it, or the whole text in another encoding."""
    text = data.decode("latin-1")
    kinds = (b"\xef\xbb\xbf" + data, b"\xff\xfe" + data, text.encode("utf-16"), text.encode("utf-32"), data * 2)
    return r.choice([*kinds, data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r")])


def nested(r: random.Random, data: bytes) -> bytes:
    """Brackets within brackets, and keys of thousands of parts."""
    depth = r.choice([50, 100, 1000, 20_000])
    kinds = (
        b"x = " + b"[" * depth + b"]" * depth,
        b"x = " + b"[" * depth,
        b"x = " + b"{a=" * depth + b"1" + b"}" * depth,
        b".".join([b"a"] * depth) + b" = 1",
        b"[" + b".".join([b"a"] * depth) + b"]",
    )
    at = r.choice([0, len(data)])
    return data[:at] + b"\n" + r.choice(kinds) + b"\n" + data[at:]


def long_field(r: random.Random, data: bytes) -> bytes:
    """A field, a line or a text that is longer than readers expect."""
    at = _place(r, data)
    return data[:at] + r.choice([b"a", b"1", b'"', b" ", b","]) * r.choice([131_073, 300_000]) + data[at:]


def large(r: random.Random, data: bytes) -> bytes:
    """A file of 10 MB: lines again and again, comments, blanks."""
    rows = data.split(b"\n")
    row = (
        r.choice([rows[-1] or rows[-2] if len(rows) > 1 else data, b"#" * 80, b"", b" " * 1000, r.choice(rows)]) + b"\n"
    )
    return data + row * (LARGE // len(row))


SMALL: tuple[Callable[[random.Random, bytes], bytes], ...] = (
    flip, cut, truncate, repeat, noise, strange, marked, *[lines] * 2, *[value] * 5,
)  # fmt: skip
RARE = (nested, long_field)


def mutated(data: bytes, seed: str, binary: bool = False) -> bytes:
    """The file, changed at one to four places; one in sixty is made large, one in eight nested or long."""
    r = random.Random(seed)
    if binary:
        for _ in range(r.choice([1, 1, 1, 2, 8])):
            data = r.choice([flip, flip, flip, cut, truncate, noise, repeat])(r, data or b"\x00")
        return data
    for _ in range(r.choice([1, 1, 1, 2, 4])):
        data = r.choice(SMALL)(r, data or b" ")
    if r.random() < 0.12:
        data = r.choice(RARE)(r, data or b" ")
    if r.random() < 0.016:
        data = large(r, data or b" ")
    return data
