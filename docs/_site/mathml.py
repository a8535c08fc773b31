"""Equations in letters, as I_{k+1} − I_k = ⟨𝒦_k, Δ⁻⟩, as MathML, which browsers draw without a program or a network.

Letters and single signs are variables, words are upright, _ and ^ and the small digits of Unicode are scripts, dots and
bars over letters are accents, Σ_k has its index below it, and a quotient without spaces, as ∂ℓ/∂ξ, is a fraction.
Lines are the rows of a table; three spaces or more begin another column, but for those behind a comma.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from html import escape

FUNCTIONS = frozenset(
    re.findall(
        r"\w+",
        "sin cos tan cot sec asin acos atan atan2 arcsin arctan sinh cosh tanh exp log ln sqrt min max lim sup inf "
        "det tr diag vee hat cay sign rank Ad ad dim ker div curl grad SO SE SL SU Sp GL so se sl su sp Re Im",
    )
)
SHORT_WORDS = {"so", "of", "in", "is", "if", "or", "by", "to", "at", "on", "as", "an", "be", "we", "it", "no"}
BELOW = {"Σ", "min", "max", "lim", "sup", "inf"}
HALVES = {"½": (1, 2), "¼": (1, 4), "¾": (3, 4), "⅓": (1, 3), "⅔": (2, 3), "⅙": (1, 6), "⅛": (1, 8)}
RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ᵀᵖᵛⁿᴺᵏᵈ⊤′", "0123456789+−TpvnNkd⊤′", strict=True))
LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉₊₋ₐₑᵢⱼₖₘₙₓ", "0123456789+−aeijkmnx", strict=True))
ACCENTS = {"\u0307": "˙", "\u0308": "¨", "\u0302": "^", "\u0303": "~", "\u0304": "¯", "\u20d7": "→"}
OPENING, CLOSING = "([{⟨", ")]}⟩"
INDEX = re.compile(r"[−-]?(?:(?:[a-z]{1,8}|[A-Z]{1,8})\d*|\d+|[^\W\dA-Za-z_][\u0300-\u036f]*)|[½×⊤∗*]")
IDENTIFIER = re.compile(r"[A-Za-z]{3,}(?:[_.][A-Za-z]\w*)+|`[^`]*`")
WORD = re.compile(r"[A-Za-z]+")
NUMBER = re.compile(r"\d+(?:[.,]\d+)*")
LABEL = re.compile(r"\([PB]?\d[^()]*\)(?:, \([PB]?\d[^()]*\))*\.?")
COLUMNS = re.compile(r"(?<=[^\s,;]) {3,}(?=\S)")
STOPS = set("=<>≤≥≈≠∈→↦⇒+−-±·×⋄∘,;:∧⊕⊗~")
SPACE, FRACTION = "space", "/"


@dataclass
class Item:
    """A piece of an equation: its MathML, and its kind: atom, function, group, space, gap, word, stop or /."""

    markup: str
    kind: str = "atom"
    inside: str = ""


def rendered(text: str) -> str:
    """The block of an equation of one or more lines."""
    lines = [line for line in text.strip("\n").splitlines() if line.strip()]
    least = min(len(line) - len(line.lstrip()) for line in lines)
    rows = [COLUMNS.split(line[least:].rstrip()) for line in lines]
    width = max(map(len, rows))
    if len(rows) == width == 1:
        return f'<math display="block">{line_of(rows[0][0])}</math>'
    table = "".join("<mtr>" + "".join(f"<mtd>{line_of(cell)}</mtd>" for cell in row) + "</mtr>" for row in rows)
    large = "false" if max(map(len, lines)) > 75 else "true"
    return f'<math display="block"><mtable displaystyle="{large}" columnalign="left">{table}</mtable></math>'


def line_of(text: str) -> str:
    indent = len(text) - len(text.lstrip())
    if LABEL.fullmatch(text):
        return f"<mtext>{text}</mtext>"
    items, _ = parsed(unicodedata.normalize("NFD", text.strip()), 0, "")
    shift = f'<mspace width="{0.5 * indent}em"></mspace>' if indent else ""
    return f"<mrow>{shift}{joined(items)}</mrow>"


def parsed(text: str, at: int, until: str) -> tuple[list[Item], int]:
    """The items of a text from a place on, to the closing bracket that ends them or to the end."""
    items: list[Item] = []
    while at < len(text) and text[at] != until:
        item, at = one(text, at)
        if item.kind in (SPACE, "gap"):
            items.append(item)
            continue
        lower, upper, at = scripts(text, at, item)
        items.append(with_scripts(item, lower, upper))
    return items, at


def one(text: str, at: int) -> tuple[Item, int]:
    """The item that begins at a place, without its scripts."""
    sign = text[at]
    if sign == " ":
        end = at + len(text[at:]) - len(text[at:].lstrip())
        return Item(
            f'<mspace width="{0.28 if end < at + 3 else 1.5}em"></mspace>', SPACE if end < at + 3 else "gap"
        ), end
    if found := IDENTIFIER.match(text, at):
        return Item(f"<mtext>{escape(found[0].strip('`'))}</mtext>", "word"), found.end()
    if found := NUMBER.match(text, at):
        return Item(f"<mn>{found[0]}</mn>"), found.end()
    if (found := WORD.match(text, at)) and (item := word(found[0])):
        return item, found.end()
    if sign in OPENING:
        return bracket(text, at)
    if sign in HALVES:
        quotient = fraction(*(f"<mn>{number}</mn>" for number in HALVES[sign]))
        return Item(f'<mstyle displaystyle="false">{quotient}</mstyle>'), at + 1
    if sign.isalpha() or sign in "∂∇∞∅":
        return letter(text, at)
    if sign == "/":
        return Item("<mo>/</mo>", FRACTION), at + 1
    shown = {"-": "−", "*": "∗"}.get(sign, sign)
    stretchy = ' stretchy="false"' if sign in "|‖/" else ""
    return Item(f"<mo{stretchy}>{escape(shown)}</mo>", "stop" if sign in STOPS else "atom"), at + 1


def word(text: str) -> Item | None:
    """A function, or a word of a sentence; other letters are variables, one by one."""
    if text in FUNCTIONS:
        return Item(f"<mi>{text}</mi>", "function", text)
    if len(text) > 2 or text in SHORT_WORDS:
        return Item(f"<mtext>{text}</mtext>", "word")
    return None


def letter(text: str, at: int) -> tuple[Item, int]:
    """A letter and the accents over it."""
    sign, end = text[at], at + 1
    if sign == "Σ" and text[end : end + 1] in ("_", " "):
        return Item('<mo largeop="true">∑</mo>', "function", "Σ"), end
    markup = f"<mi>{escape(sign)}</mi>"
    while end < len(text) and unicodedata.combining(text[end]):
        accent = ACCENTS.get(text[end])
        markup = f'<mover accent="true">{markup}<mo stretchy="false">{accent}</mo></mover>' if accent else markup
        end += 1
    return Item(markup), end


def bracket(text: str, at: int) -> tuple[Item, int]:
    """What stands in brackets, or a bracket alone if it is not closed."""
    close = CLOSING[OPENING.index(text[at])]
    items, end = parsed(text, at + 1, close)
    if end >= len(text):
        return Item(f'<mo stretchy="false">{text[at]}</mo>'), at + 1
    inside = joined(items)
    return Item(f"<mrow><mo>{text[at]}</mo>{inside}<mo>{close}</mo></mrow>", "group", inside), end + 1


def scripts(text: str, at: int, base: Item) -> tuple[str, str, int]:
    """What is lowered and raised behind an item."""
    lower, upper = "", ""
    while at < len(text):
        sign = text[at]
        if sign in RAISED or sign in LOWERED:
            table = RAISED if sign in RAISED else LOWERED
            end = at
            while end < len(text) and text[end] in table:
                end += 1
            found = line_of("".join(table[one] for one in text[at:end]))
            lower, upper = (lower, upper + found) if sign in RAISED else (lower + found, upper)
            at = end
        elif sign == "*" and base.kind != "stop" and text[at - 1] != " " and text[at + 1 : at + 2] != " ":
            upper, at = upper + "<mo>∗</mo>", at + 1
        elif sign in "_^" and base.kind != "word":
            found, end = script(text, at + 1)
            if not found:
                break
            lower, upper, at = (lower + found, upper, end) if sign == "_" else (lower, upper + found, end)
        else:
            break
    return lower, upper, at


def script(text: str, at: int) -> tuple[str, int]:
    """The script that begins behind _ or ^, of a group in braces or of one index."""
    if text[at : at + 1] == "{":
        items, end = parsed(text, at + 1, "}")
        return f"<mrow>{joined(items)}</mrow>", end + 1
    found = INDEX.match(text, at)
    if not found:
        return "", at
    if found[0].isalpha() and found[0].isascii() and len(found[0]) > 1:
        return f"<mi>{found[0]}</mi>", found.end()
    return line_of(found[0]), found.end()


def with_scripts(item: Item, lower: str, upper: str) -> Item:
    if not lower and not upper:
        return item
    under = item.kind == "function" and item.inside in BELOW
    name = {(True, False): "sub", (False, True): "sup", (True, True): "subsup"}[bool(lower), bool(upper)]
    if under:
        name = {"sub": "under", "sup": "over", "subsup": "underover"}[name]
    pieces = "".join(f"<mrow>{part}</mrow>" for part in (lower, upper) if part)
    kind = "atom" if item.kind == "group" else item.kind
    return Item(f"<m{name}>{item.markup}{pieces}</m{name}>", kind, item.inside if kind == "function" else "")


def fraction(top: str, bottom: str) -> str:
    return f"<mfrac><mrow>{top}</mrow><mrow>{bottom}</mrow></mfrac>"


def joined(items: list[Item]) -> str:
    """The items in order, with quotients as fractions."""
    done: list[Item] = []
    at = 0
    while at < len(items):
        item = items[at]
        above = run_before(done) if item.kind == FRACTION else 0
        below = run_after(items, at + 1) if above else 0
        if below:
            top, bottom = done[-above:], items[at + 1 : at + 1 + below]
            done[-above:] = [Item(fraction(bare(top), bare(bottom)))]
            at += 1 + below
        else:
            done.append(item)
            at += 1
    signs = [True, *(item.kind in ("stop", "gap") for item in done), True]  # which have spaces of their own
    for k, item in enumerate(done):
        if signs[k] and item.markup in ("<mo>−</mo>", "<mo>+</mo>"):
            done[k] = Item(item.markup.replace("<mo>", '<mo form="prefix">'), "stop")
    shown = [k for k, item in enumerate(done) if item.kind != SPACE or not (signs[k] or signs[k + 2])]
    return "".join(done[k].markup for k in shown)


def run_before(items: list[Item]) -> int:
    """How many items a slash has above it: those since a space or a sign, and none behind a function's name."""
    count = 0
    while count < len(items) and items[-1 - count].kind in ("atom", "group", "function"):
        count += 1
    before = items[: len(items) - count]
    named = [item for item in before if item.kind != SPACE][-1:]
    spaced = bool(before) and before[-1].kind == SPACE
    return 0 if spaced and named and named[0].kind == "function" and named[0].inside != "Σ" else count


def run_after(items: list[Item], at: int) -> int:
    """How many items a slash has below it; a function takes its argument along."""
    end = at
    while end < len(items) and items[end].kind in ("atom", "group", "function"):
        end += 1
    named = end > at and items[end - 1].kind == "function"
    if named and end + 1 < len(items) and items[end].kind == SPACE:
        return run_after(items, end + 1) + end + 1 - at
    return end - at


def bare(items: list[Item]) -> str:
    """The items, without the brackets of one that stands alone."""
    if len(items) == 1 and items[0].kind == "group":
        return items[0].inside
    return "".join(item.markup for item in items)
