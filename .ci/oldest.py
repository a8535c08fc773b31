"""The oldest dependencies that pyproject.toml admits, as pins for pip: `>=` becomes `==`.

python .ci/oldest.py > constraints.txt && pip install --constraint constraints.txt ".[test]"
"""

import re
import tomllib
from pathlib import Path

LOWER = re.compile(r"([\w.-]+)(?:\[[\w,]+\])?>=([\w.]+)")


def pins(pyproject: dict) -> list[str]:
    """One line `name==version` for each dependency; raises ValueError for one without a lower bound."""
    project = pyproject["project"]
    found = []
    for requirement in [*project["dependencies"], *project["optional-dependencies"]["test"]]:
        bound = LOWER.match(requirement)
        if bound is None:
            raise ValueError(f"Dependency `{requirement}` must have a lower bound, as in numpy>=2.0.")
        found.append(f"{bound[1]}=={bound[2]}")
    return found


if __name__ == "__main__":
    print("\n".join(pins(tomllib.loads(Path("pyproject.toml").read_text("utf-8")))))
