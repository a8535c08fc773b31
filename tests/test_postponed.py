"""Postponed packages run their files when a name of theirs is read, once, into the same modules."""

from __future__ import annotations

import importlib
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from coadjoint import postponed
from coadjoint.errors import FileError

FILES = {
    "__init__.py": "import builtins\nbuiltins.slow_runs = getattr(builtins, 'slow_runs', 0) + 1\n"
    "import time; time.sleep(0.02)\nfrom slow_parts import inner as inner\nvalue = inner.value + 1\n",
    "inner.py": "value = 1\n",
    "other/__init__.py": "",
    "other/deep.py": "from slow_parts import value\nvalue = 10 * value\n",
}


@pytest.fixture
def slow(tmp_path, monkeypatch):
    """A package that counts how often its file is run, postponed."""
    import builtins

    for name, text in FILES.items():
        path = tmp_path / "slow_parts" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", sys.meta_path[:])
    monkeypatch.setattr(builtins, "slow_runs", 0, raising=False)
    for kept in (postponed._waiting, postponed._calls, postponed._stand_ins):
        monkeypatch.setattr(postponed, kept_name(kept), {})
    postponed.postpone("slow_parts", {"slow_parts.inner": {"stand_in": 7}})
    yield builtins
    for name in [name for name in sys.modules if name.startswith("slow_parts")]:
        del sys.modules[name]


def kept_name(kept: object) -> str:
    return next(name for name, value in vars(postponed).items() if value is kept)


def test_imports_run_nothing_before_a_name_is_read(slow):
    from slow_parts import inner
    from slow_parts.other import deep

    package = importlib.import_module("slow_parts")
    assert slow.slow_runs == 0 and not postponed.loaded("slow_parts")
    assert package.__name__ == "slow_parts" and Path(package.__path__[0]).name == "slow_parts"
    assert inner.stand_in == 7 and not postponed.loaded("slow_parts")
    assert deep.value == 20 and slow.slow_runs == 1 and postponed.loaded("slow_parts")
    assert type(package) is type(inner) is type(sys)
    assert sys.modules["slow_parts.inner"] is package.inner is inner and sys.modules["slow_parts.other.deep"] is deep
    assert not hasattr(inner, "stand_in") and deep.__spec__.loader is deep.__loader__
    with pytest.raises(AttributeError, match="has no attribute 'absent'"):
        _ = package.absent


def test_a_module_that_does_not_exist_is_missing_at_once(slow):
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("slow_parts.absent")
    assert slow.slow_runs == 0


def test_a_package_that_cannot_be_loaded_is_named_with_the_reason(slow, tmp_path):
    (tmp_path / "slow_parts" / "__init__.py").write_text("raise ValueError('invalid truth value banana')\n")
    package = importlib.import_module("slow_parts")
    with pytest.raises(FileError, match="Package slow_parts cannot be loaded: ValueError: invalid truth value banana;"):
        _ = package.value


def test_calls_wait_for_the_package(slow):
    called: list[int] = []
    package = importlib.import_module("slow_parts")
    postponed.when_loaded("slow_parts", lambda: called.append(package.value))
    assert called == []
    postponed.load("slow_parts")
    postponed.when_loaded("slow_parts", lambda: called.append(0))
    assert called == [2, 0] and postponed.waited("slow_parts")


def test_threads_wait_for_the_one_that_loads(slow):
    package, found = importlib.import_module("slow_parts"), []
    threads = [threading.Thread(target=lambda: found.append(package.value)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [2] * 8 and slow.slow_runs == 1


PROGRAM = """
import sys
from coadjoint.before_jax import STAND_INS
from coadjoint.postponed import loaded, postpone
for package in ("jax", "xarray", "pandas"):
    postpone(package, STAND_INS if package == "jax" else None)
import coadjoint.simulation.simulate, coadjoint.simulation.resume, coadjoint.report.reproduction
import coadjoint_vehicles.missions.file
from coadjoint.mechanics.state import State
assert not any(map(loaded, ("jax", "xarray", "pandas"))), "loaded"
import jax
import jax.numpy as jnp
import coadjoint as co
assert float(jax.grad(lambda x: jnp.sin(x) ** 2)(0.0)) == 0.0 and loaded("jax")
body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
assert len(jax.tree.leaves(body.state(xi=[0.0, 1.0, 2.0]))) == 9, jax.tree.leaves(body.state())
"""


def test_the_modules_of_a_run_load_neither_jax_nor_xarray():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
