"""Six examples become notebooks that hold the same program and run."""

from __future__ import annotations

import ast
import json
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "_site"))
import notebooks


def program(path: Path) -> str:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


def test_six_examples_become_notebooks_with_the_same_program(tmp_path: Path) -> None:
    written = notebooks.write(tmp_path)
    assert len(written) == 6
    for path in written:
        script = (notebooks.EXAMPLES / f"{path.stem}.py").read_text(encoding="utf-8")
        tree = ast.parse(notebooks.GIVEN.sub("", script).replace("import sys\n", ""))
        assert ast.dump(ast.parse(program(path))) == ast.dump(ast.Module(tree.body[1:], [])), path.name
        content = json.loads(path.read_text(encoding="utf-8"))
        assert "".join(content["cells"][0]["source"]).startswith("# ") and len(content["cells"]) > 5
        assert "argv" not in program(path)
        assert not any(cell.get("outputs") for cell in content["cells"])


@pytest.mark.long
@pytest.mark.skipif(any(find_spec(name) is None for name in ("nbclient", "ipykernel")), reason="needs coadjoint[docs]")
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", notebooks.NAMES)
def test_a_notebook_runs_and_shows_its_figure(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import nbclient
    import nbformat

    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel chooses the one that shows figures in cells
    notebooks.write(tmp_path)
    read = nbformat.read(tmp_path / f"{name}.ipynb", as_version=4)
    done = nbclient.NotebookClient(read, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in done.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.output_type == "error"]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert "".join(output.get("text", "") for output in outputs)
    nbformat.validate(done)
