"""Files and folders of runs get the permissions that the system gives new ones."""

import os
import stat

import pytest

import coadjoint as co
from paper_vehicle import start, system


@pytest.mark.cases(1)
@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("lacking", [0o022, 0o077, 0o007])
def test_saving_follows_the_umask_and_never_changes_it(tmp_path, monkeypatch, lacking):
    """os.umask holds for all threads of a process: setting it, if for a moment, opens the files of others."""
    vehicle, real = system(), os.umask
    before = real(lacking)
    try:
        monkeypatch.setattr(os, "umask", lambda _: pytest.fail("the umask was changed"))
        run = co.simulate(vehicle, start(vehicle), dt=0.01, steps=2, store=tmp_path / "folder", monitors=False)
        run.save(tmp_path / "run.nc")
    finally:
        real(before)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert modes == {"folder": 0o777 & ~lacking, "run.nc": 0o666 & ~lacking}
