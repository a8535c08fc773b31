"""Names that no file can have: one clear error wherever a file or a call may give one."""

from __future__ import annotations

import pytest

import coadjoint as co
from coadjoint.cli.main import main

TOP = '[system]\nmodel = "simo_wong_top"\n[run]\ndt = 0.001\nsteps = 2\n'
SWEEP = '[sweep]\nrun = "NAME"\n[vary.parameters]\nmass = { values = [4.0, 5.0] }\n'


@pytest.mark.parametrize("name", ["\\u0000", "a\\u0000.toml", "x" * 5000], ids=["NUL", "with NUL", "long"])
@pytest.mark.parametrize("command", ["sweep", "run"])
def test_a_name_that_no_file_can_have_is_one_error(tmp_path, monkeypatch, capsys, command, name):
    monkeypatch.chdir(tmp_path)
    text = SWEEP.replace("NAME", name) if command == "sweep" else f'{TOP}[output]\nfolder = "{name}"\n'
    (tmp_path / "file.toml").write_text(text)
    assert main([command, "file.toml"]) == 2
    told = capsys.readouterr().err
    assert len(told.strip().splitlines()) == 1 and ("NUL" in told or "File name too long" in told)


def test_calls_refuse_a_name_with_a_nul(tmp_path):
    (tmp_path / "top.toml").write_text(TOP)
    top = co.models.catalogue["simo_wong_top"].make()
    start = top.state(xi=[0, 0, 1.0], a0=[0, 0, 1])
    with pytest.raises(co.errors.ArgumentError, match="Argument `store` must be the path of a folder"):
        co.simulate(top, start, dt=0.01, steps=1, store="\0")
    with pytest.raises(co.errors.ArgumentError, match="Argument `path` must be the name of a file"):
        co.load("\0.nc")
    with pytest.raises(co.errors.FileError, match="which holds a NUL"):
        co.sweep(tmp_path / "top.toml", mass=co.each([4.0, 5.0]), store="\0")
    with pytest.raises(co.errors.FileError, match="cannot hold a NUL"):
        co.sweep("\0", mass=co.each([4.0, 5.0]))
