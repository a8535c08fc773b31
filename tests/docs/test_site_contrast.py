"""Contrast of the site, of reports and of figures: WCAG 2.1 AA, 4.5 : 1 for text, 3 : 1 for lines and underlines."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from coadjoint.plotting.style import COLOURS, WANTED
from coadjoint.report import page

ROOT = Path(__file__).parents[2]
needs_furo = pytest.mark.skipif(find_spec("furo") is None, reason="needs coadjoint[docs]")
TEXT, LINES = 4.5, 3.0
WHITE = "#ffffff"

ON_PAGE = ("foreground-primary", "foreground-secondary", "foreground-muted", "link", "link--visited", "problematic")
ON_PAGE += ("api-keyword", "api-name", "api-paren", "toc-item-text", "toc-item-text--active", "toc-title-text")
ON_SHADE = ("foreground-primary", "foreground-secondary", "sidebar-caption-text", "sidebar-link-text", "link")
ON_SHADE += ("sidebar-link-text--top-level", "sidebar-brand-text", "sidebar-search-text", "sidebar-search-icon")
PAIRS = [(text, "background-primary") for text in ON_PAGE] + [(text, "background-secondary") for text in ON_SHADE]
PAIRS += [(text, "background-hover") for text in ("sidebar-link-text", "sidebar-link-text--top-level", "api-name")]
PAIRS += [("highlighted-text", "highlighted-background")]


def luminance(colour: str) -> float:
    """Relative luminance of #rgb or #rrggbb: 0.2126 R + 0.7152 G + 0.0722 B of linear components."""
    digits = colour.lstrip("#")
    digits = "".join(2 * digit for digit in digits) if len(digits) == 3 else digits
    assert re.fullmatch("[0-9a-fA-F]{6}", digits), colour
    parts = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def declared(css: str, selectors: tuple[str, ...]) -> dict[str, str]:
    """The variables that rules of these selectors set, later ones over earlier ones."""
    found: dict[str, str] = {}
    for selector, body in re.findall(r"([^{}]+)\{([^{}]*)\}", re.sub(r"/\*.*?\*/", "", css, flags=re.DOTALL)):
        if selector.strip().replace('"', "") in selectors:
            found |= dict(re.findall(r"--color-([\w-]+):\s*([^;]+)", body))
    return found


def colours(mode: str) -> dict[str, str]:
    """The colours of Furo with those of the site in one mode."""
    found = find_spec("furo")
    assert found is not None and found.submodule_search_locations
    theme = Path(found.submodule_search_locations[0]) / "theme/furo/static/styles/furo.css"
    css = theme.read_text("utf-8") + (ROOT / "docs/_static/site.css").read_text("utf-8")
    return declared(css, ("body", "body[data-theme=dark]") if mode == "dark" else ("body",))


def value(found: dict[str, str], name: str) -> str:
    """A colour, through the variables that it names."""
    held = found[name].strip()
    named = re.fullmatch(r"var\(\s*--color-([\w-]+)\s*\)", held)
    return value(found, named[1]) if named else held


def test_contrast_is_that_of_the_guideline() -> None:
    assert contrast("#fff", "#000000") == pytest.approx(21)
    assert contrast("#777", WHITE) == pytest.approx(4.48, abs=0.005)


@needs_furo
@pytest.mark.parametrize("mode", ["light", "dark"])
def test_text_of_the_site_stands_out_from_its_ground(mode: str) -> None:
    found = colours(mode)
    ratios = {pair: contrast(*(value(found, name) for name in pair)) for pair in PAIRS}
    assert {pair: ratio for pair, ratio in ratios.items() if ratio < TEXT} == {}


@needs_furo
@pytest.mark.parametrize("mode", ["light", "dark"])
def test_links_in_text_are_known_by_an_underline_that_is_seen(mode: str) -> None:
    """In the dark mode their colour alone differs too little from that of the text around them."""
    found = colours(mode)
    for name in ("link-underline", "link-underline--visited"):
        assert contrast(value(found, name), value(found, "background-primary")) >= LINES


@needs_furo
@pytest.mark.parametrize("name", ["a11y-light", "a11y-dark"])
def test_each_colour_of_code_stands_out_from_its_ground(name: str) -> None:
    from pygments.styles import get_style_by_name
    from pygments.token import Token

    style = get_style_by_name(name)
    plain = style.style_for_token(Token.Text)["color"] or ("515151" if name == "a11y-light" else "f8f8f2")
    assert name in (ROOT / "docs/conf.py").read_text("utf-8")
    low = {
        str(token): ratio
        for token, look in style
        if (ratio := contrast(look["color"] or plain, look["bgcolor"] or style.background_color)) < TEXT
    }
    assert low == {}


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_text_of_a_report_stands_out_from_its_ground(mode: str) -> None:
    text = Path(page.__file__).read_text("utf-8")
    light, dark = re.findall(r":root \{([^}]*)\}", text)
    found = dict(re.findall(r"--(\w+): (#\w+)", dark if mode == "dark" else light))
    for ground in ("ground", "shade"):
        assert min(contrast(found[ink], found[ground]) for ink in ("ink", "faint")) >= TEXT


def test_curves_of_figures_stand_out_from_white() -> None:
    """The site and reports give figures a white ground in both modes."""
    assert {colour: contrast(colour, WHITE) for colour in COLOURS if contrast(colour, WHITE) < LINES} == {}
    assert contrast(str(WANTED["color"]), WHITE) >= TEXT
    css = (ROOT / "docs/_static/site.css").read_text("utf-8")
    assert css.count("article img { background: #fff; }") == 2
