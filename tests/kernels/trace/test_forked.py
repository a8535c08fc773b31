"""A process that was forked after XLA had begun is told so by what needs XLA, and runs native code."""

from __future__ import annotations

import os
import subprocess
import sys

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace import fork_safety
from coadjoint.kernels.trace.evaluate import evaluate

PROGRAM = """
import os
import signal
import jax
import numpy as np
import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate

parameters = co.Parameters(inertia=np.diag([1.0, 2, 3]))
body = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters=parameters)
start = body.state(xi=[1, 2, 3.0])
def run(backend):
    return co.simulate(body, start, dt=0.01, steps=5, backend=backend, accuracy=False).final
expected = run("xla")
BY_XLA = {
    "run": lambda: run("xla"),
    "trajectory": lambda: co.trajectory(body, start, dt=0.01, steps=5, backend="xla"),
    "stepper": lambda: co.Stepper(body, start, dt=0.01, backend="xla").step(),
    "function": lambda: evaluate(jax.numpy.linalg.eigh, np.eye(2)),
}
child = os.fork()
if child == 0:
    signal.alarm(60)  # ends a child that waits
    try:
        assert np.allclose(run("native").xi, expected.xi, rtol=0, atol=1e-13)
        for name, function in BY_XLA.items():
            try:
                function()
            except co.errors.ArgumentError as error:
                print(name, error, flush=True)
    finally:
        os._exit(0)
os.waitpid(child, 0)
"""


def test_what_needs_xla_is_refused_in_a_fork_of_a_process_in_which_it_had_begun(monkeypatch):
    monkeypatch.setattr(fork_safety, "_forked", False)
    for begun in (False, True):
        fork_safety.require_own_xla()
        monkeypatch.setattr(fork_safety, "_begun", not begun)
        monkeypatch.setattr(fork_safety, "xla_has_begun", lambda begun=begun: begun)
        fork_safety._before()
        fork_safety._in_child()
    body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    needs = [
        lambda: evaluate(jax.numpy.linalg.eigh, np.eye(2)),
        lambda: co.trajectory(body, body.state(xi=[1.0]), dt=0.1, steps=1, backend="xla"),
        lambda: co.simulate(body, body.state(xi=[1.0]), dt=0.1, steps=1, backend="xla", accuracy=False),
        lambda: co.Stepper(body, body.state(xi=[1.0]), dt=0.1, backend="xla", accuracy=False).step(),
    ]
    for use in needs:
        with pytest.raises(co.errors.ArgumentError, match="forked after XLA had begun"):
            use()


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this machine")
def test_xla_is_refused_in_a_fork_where_it_would_wait_forever_and_native_code_runs():
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    found = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    said = [line.partition(" ") for line in found.stdout.splitlines()]
    assert [name for name, _, _ in said] == ["run", "trajectory", "stepper", "function"], found.stderr
    assert all(sentence.startswith("This process was forked after XLA had begun") for _, _, sentence in said)
