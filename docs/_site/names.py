"""The API reference: every public name on one page, and links to it from every `co.name` in code.

A block ```{api} PACKAGE``` on a page stands for the names in it, or for all public names of the package that no other
block has. `documented` is that list; a test compares it with what is public.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

BLOCK = re.compile(r"^```\{api\} ([\w.]+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
WRITTEN = re.compile(r"^co\.([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)(?:\(.*\))?$", re.DOTALL)


def package_of(name: str) -> Any:
    """The package of this name, be it a folder or one that `coadjoint` calls so, as `coadjoint.attitude`."""
    first, *others = name.split(".")
    found: Any = import_module(first)
    for i, other in enumerate(others, 2):
        found = getattr(found, other, None) or import_module(".".join(name.split(".")[:i]))
    return found


def public_names(package: str) -> list[str]:
    """What a package lists as public; of a module without a list, what is defined in it."""
    module = package_of(package)
    listed = getattr(module, "__all__", None)
    if listed is not None:
        return sorted(name for name in listed if not isinstance(getattr(module, name), ModuleType))
    own = [
        n for n, v in vars(module).items() if not n.startswith("_") and getattr(v, "__module__", "") == module.__name__
    ]
    return sorted(own)


def blocks(folder: Path) -> Iterator[tuple[str, list[str], str]]:
    """(package, names, page) of every block in a folder of pages."""
    for page in sorted(folder.glob("*.md")):
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            yield block[1], block[2].split(), page.stem


def documented(folder: Path) -> dict[str, Any]:
    """Every name of the reference, as `coadjoint.control.Problem`, with what it is."""
    found: dict[str, Any] = {}
    for package, names, _ in blocks(folder):
        found.update({f"{package}.{name}": getattr(package_of(package), name) for name in names})
    for package, names, _ in blocks(folder):
        if not names:
            found.update(rest(package, found))
    return found


def rest(package: str, found: dict[str, Any]) -> dict[str, Any]:
    """The public names of a package that are not there yet."""
    known = {id(value) for value in found.values()}
    module = package_of(package)
    return {f"{package}.{n}": getattr(module, n) for n in public_names(package) if id(getattr(module, n)) not in known}


def directive(full: str, thing: Any) -> str:
    """What Sphinx needs to describe a name."""
    if inspect.isclass(thing):
        kind = "autoexception" if issubclass(thing, BaseException) else "autoclass"
        return f".. {kind}:: {full}\n   :members:\n"
    return f".. {'autofunction' if inspect.isroutine(thing) else 'autodata'}:: {full}\n"


def expand(app: Sphinx, name: str, source: list[str]) -> None:
    """Blocks of names become directives."""
    folder = Path(app.srcdir) / "docs" / "api"
    if not name.startswith("docs/api/"):
        return

    def directives(block: re.Match) -> str:
        package, names = block[1], block[2].split()
        every = documented(folder)
        listed = {f"{p}.{n}" for p, given, _ in blocks(folder) for n in given}
        mine = [f"{package}.{n}" for n in names] or [
            full for full in every if full.rpartition(".")[0] == package and full not in listed
        ]
        return "```{eval-rst}\n" + "\n".join(directive(full, every[full]) for full in mine) + "\n```"

    source[0] = BLOCK.sub(directives, source[0])


class Links(SphinxTransform):
    """`co.simulate(…)` in code, on any page, leads to its place in the reference."""

    default_priority = 870

    def apply(self, **kwargs: Any) -> None:
        homes = self.app.config.coadjoint_names
        for literal in list(self.document.findall(nodes.literal)):
            written = WRITTEN.match(literal.astext())
            home = homes.get(f"coadjoint.{written[1]}") if written else None
            inside = isinstance(literal.parent, nodes.reference | addnodes.pending_xref)
            if home is None or inside:
                continue
            link = addnodes.pending_xref("", refdomain="py", reftype="obj", reftarget=home, refexplicit=True)
            link["refdoc"] = self.env.docname
            literal.replace_self(link)
            link += literal


def collect(app: Sphinx, config: Any) -> None:
    """Every way of writing a documented name, with the one under which it is documented."""
    folder = Path(app.srcdir) / "docs" / "api"
    every = documented(folder)
    homes = {id(value): full for full, value in every.items()}
    packages = {package for package, _, _ in blocks(folder)}
    config.coadjoint_names = {full: full for full in every}
    for package in packages:
        module = package_of(package)
        for name in public_names(package):
            home = homes.get(id(getattr(module, name)))
            if home:
                config.coadjoint_names.setdefault(f"{package}.{name}", home)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("coadjoint_names", {}, "env")
    app.connect("config-inited", collect)
    app.connect("source-read", expand, priority=400)
    app.add_transform(Links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
