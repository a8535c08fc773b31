"""What interrupts the command line while it loads is told in one sentence."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")
BEGINNING = """
import runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["coadjoint", "stability", "remus_100"]
"""
AT_A_MODULE = """
class Finder:
    def find_spec(name, path, target=None):
        name == {module!r} and signal.raise_signal(signal.{number})
sys.meta_path.insert(0, Finder)
"""
IN_EXTENSIONS = """
def hook(event, given):
    if event == "import" and given[1] and given[1].endswith(".so") and {module!r} in given[0] and not came:
        came.append(given[0])
        signal.raise_signal(signal.{number})
        print("goes on")
came = []
sys.addaudithook(hook)
"""
END = "runpy.run_module('coadjoint', run_name='__main__')\n"


def ended(code: str):
    return subprocess.run([sys.executable, "-c", BEGINNING + code + END], capture_output=True, text=True)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("number", "status", "word"), [("SIGINT", 130, "Interrupted"), ("SIGTERM", 143, "Terminated")])
@pytest.mark.parametrize("module", ["coadjoint.cli.main", "tyro", "jax", "numpy.linalg"])
def test_a_module_of_python(module, number, status, word):
    done = ended(AT_A_MODULE.format(module=module, number=number))
    assert (done.returncode, done.stdout) == (status, "")
    assert done.stderr.removeprefix("Reading remus_100.\n") == f"{word}.\n"


@pytest.mark.cases(1)
@pytest.mark.parametrize("module", ["_jax", "_multiarray_umath"])
def test_an_extension_in_c_is_loaded_to_its_end(module):
    """Where Python raises in it, the process may crash."""
    done = ended(IN_EXTENSIONS.format(module=module, number="SIGINT"))
    assert done.returncode == 130 and done.stderr.endswith("Interrupted.\n") and done.stdout.startswith("goes on\n")
