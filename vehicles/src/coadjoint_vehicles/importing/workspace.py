"""Packages of a workspace: where files that others include are."""

from __future__ import annotations

import os
from pathlib import Path

MOST_FOLDERS = 5000
"""How many folders are looked through for a package."""


def package_folder(workspace: Path, name: str) -> Path:
    """The folder of a package in a workspace: itself, one in it, or the nearest one below; workspace/name if none is.

    Of several on one level one with a package.xml comes first.
    """
    if workspace.resolve().name == name and not (workspace / name).is_dir():
        return workspace
    level, seen = [workspace], 0
    while level and seen < MOST_FOLDERS:
        found = [folder / name for folder in level if (folder / name).is_dir()]
        if found:
            return next((folder for folder in found if (folder / "package.xml").is_file()), found[0])
        seen += len(level)
        level = [
            Path(entry.path)
            for folder in level
            for entry in sorted(os.scandir(folder), key=lambda entry: entry.name)
            if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")
        ]
    return workspace / name


def workspace_of(file: Path) -> Path:
    """The folder that files are included from, by default: `src` or a repository above the package of the file.

    Without them that which holds the package; without a package.xml above it the file's own folder.
    """
    above = list(file.resolve().parents)
    package = next((folder for folder in above if (folder / "package.xml").is_file()), None)
    if package is None:
        return file.parent
    roots = [folder for folder in package.parents if folder.name == "src" or (folder / ".git").exists()]
    return roots[0] if roots else package.parent
