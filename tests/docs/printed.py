"""What a page shows below a block is what the block prints, but for times, counts of iterations and last digits."""

from __future__ import annotations

import re

NUMBER = re.compile(r"[-+−]?\d[\d,]*(?:\.\d*)?(?:e[-+]?\d+)?|[-+−]?\.\d+(?:e[-+]?\d+)?", re.IGNORECASE)
MARK = re.compile(f"…|{NUMBER.pattern}", re.IGNORECASE)
CLOCK = re.compile(r"\d[\d.,e+-]* ?(?:steps/s|(?:ms|µs|s)(?= to set up\b))|^(?:time|iterations) .*|\bin \d[\d.]* s\b")
ROUND_OFF = 1e-7
"""Numbers below are differences of numbers that agree, and vary from machine to machine."""


def disagreement(shown: str, printed: str) -> str | None:
    """The first line of a page that the block does not print, in order; … stands for lines or for text left out."""
    lines = [reduced(line) for line in printed.splitlines()]
    place = 0
    for line in filter(str.strip, shown.splitlines()):
        if line.strip() == "…":
            continue
        found = [k for k in range(place, len(lines)) if same(reduced(line), lines[k])]
        if not found:
            return line
        place = found[0] + 1
    return None


def reduced(line: str) -> str:
    return " ".join(CLOCK.sub("…", line).replace("/home/you/", "…").split())


def same(shown: str, printed: str) -> bool:
    """Words alike, numbers within 2 %, or both at round-off; … stands for anything."""
    words = [" *" + re.escape(piece).replace("\\ ", " *") + " *" for piece in re.split(MARK, shown)]
    marks = MARK.findall(shown)
    kinds = [".*?" if mark == "…" else f"({NUMBER.pattern}|nan)" for mark in marks]
    match = re.fullmatch("".join(map("".join, zip(words, [*kinds, ""], strict=True))), printed, re.IGNORECASE)
    if match is None:
        return False
    return all(near(a, b) for a, b in zip([m for m in marks if m != "…"], match.groups(), strict=True))


def near(shown: str, printed: str) -> bool:
    a, b = (float(text.replace(",", "").replace("−", "-")) for text in (shown, printed))
    return abs(a - b) <= max(0.02 * abs(a), ROUND_OFF)
