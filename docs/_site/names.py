"""The API reference: every public name on one page, and links to it from every `co.name` in code.

Blocks ```{api} PACKAGE``` on the pages of docs/api, which `reference` reads, become Sphinx's directives.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from reference import BLOCK, blocks, documented, package_of, public_names
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

WRITTEN = re.compile(r"^co\.([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)(?:\(.*\))?$", re.DOTALL)


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
                for written in (package, package.replace("coadjoint_", "coadjoint.", 1)):  # also as co.vehicles
                    config.coadjoint_names.setdefault(f"{written}.{name}", home)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("coadjoint_names", {}, "env")
    app.connect("config-inited", collect)
    app.connect("source-read", expand, priority=400)
    app.add_transform(Links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
