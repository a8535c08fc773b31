"""Examples as notebooks: `python docs/_site/notebooks.py FOLDER` writes them, and the site offers them for download.

The docstring becomes text, and each paragraph of the program a cell. What a script reads from its command line has the
default value.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("double_pendulum", "satellite", "quadrotor", "rolling_disk", "heisenberg", "vehicle_in_current")
GIVEN = re.compile(r"float\(sys\.argv\[1\]\) if len\(sys\.argv\) > 1 else ")
RUN_AS = re.compile(r"^Run as: .*\n", re.MULTILINE)
EQUATION = re.compile(r"(?:^    .*\n?)+", re.MULTILINE)


def notebook(script: str) -> dict[str, Any]:
    """A script with a docstring as the content of an .ipynb file, in the format 4.5."""
    program = GIVEN.sub("", script)
    if "sys." not in program:
        program = re.sub(r"^import sys\n\n?", "", program, flags=re.MULTILINE)
    tree = ast.parse(program)
    title, _, rest = (ast.get_docstring(tree) or "").partition("\n")
    text = EQUATION.sub(lambda m: f"```\n{m[0].rstrip()}\n```\n", RUN_AS.sub("", rest.strip()))
    cells = [cell(0, "markdown", f"# {title}\n\n{text}".strip())]
    for number, paragraph in enumerate(paragraphs(program, tree.body[1:]), start=1):
        cells.append(cell(number, "code", paragraph))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": kernel}, "cells": cells}


def paragraphs(program: str, statements: list[ast.stmt]) -> list[str]:
    """The statements of a program with their comments, a piece for each group without an empty line."""
    lines = program.splitlines()
    pieces: list[str] = []
    end = statements[0].lineno - 1  # without the empty line before the first
    for statement in statements:
        begin, last = end, statement.end_lineno or statement.lineno
        first = min([statement.lineno, *(one.lineno for one in getattr(statement, "decorator_list", []))])
        apart = any(not line.strip() for line in lines[begin : first - 1])
        code = "\n".join(lines[begin:last]).strip("\n")
        if apart or not pieces:
            pieces.append(code)
        else:
            pieces[-1] += "\n" + code
        end = last
    return pieces


def cell(number: int, kind: str, text: str) -> dict[str, Any]:
    made: dict[str, Any] = {"id": f"cell-{number}", "cell_type": kind, "metadata": {}}
    made["source"] = text.splitlines(keepends=True)
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def write(folder: Path) -> list[Path]:
    """The notebooks of the examples, in a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in NAMES:
        content = notebook((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))
        written.append(folder / f"{name}.ipynb")
        written[-1].write_text(json.dumps(content, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    return written


def setup(app: Any) -> dict[str, bool]:
    app.connect("build-finished", lambda app, error: error or write(Path(app.outdir) / "notebooks"))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    print(*write(Path(sys.argv[1])), sep="\n")
