"""Makes environments and the wheel, by uv where it is to be had, else by pip.

    python .ci/install.py tools HOME                          an environment with uv and build
    python .ci/install.py wheel HOME FOLDER SOURCE            source archive and wheel of the folder SOURCE
    python .ci/install.py environment HOME NEW INTERPRETER REQUIREMENT…

HOME is the environment of the tools. REQUIREMENT may be an option that both installers know, as `--constraint`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path


def done(*command: str | Path) -> bool:
    """Whether a command succeeds."""
    print("  ", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=False).returncode == 0


def tools(home: Path) -> bool:
    """An environment with `build`, and with uv where pip finds it."""
    pip = (home / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    return done(sys.executable, "-m", "venv", home) and (done(*pip, "build", "uv") or done(*pip, "build"))


def wheel(home: Path, folder: Path, source: Path) -> bool:
    """The source archive of a folder and the wheel from it."""
    uv = home / "bin/uv"
    if uv.exists() and done(uv, "build", "--quiet", "--python", sys.executable, "--out-dir", folder, source):
        return True
    return done(home / "bin/python", "-m", "build", "--outdir", folder, source)


def environment(home: Path, new: Path, interpreter: Path, *requirements: str) -> bool:
    """A new environment with requirements; pip and, with `--compile`, uv compile the byte code."""
    uv, python = home / "bin/uv", new / "bin/python"
    if uv.exists():
        made = done(uv, "venv", "--quiet", "--no-project", "--python", interpreter, new)
        install = (uv, "pip", "install", "--quiet", "--python", python)
        if made and done(*install, *requirements):
            return True
        print("uv did not install it; pip does.", flush=True)
        shutil.rmtree(new, ignore_errors=True)
    install = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    return done(interpreter, "-m", "venv", new) and done(*install, *requirements)


if __name__ == "__main__":
    task, home, *rest = sys.argv[1:]
    made = {"tools": tools, "wheel": wheel, "environment": environment}[task]
    sys.exit(
        not made(
            Path(home), *(Path(word) for word in rest[:2]), *(map(Path, rest[2:]) if task == "wheel" else rest[2:])
        )
    )
