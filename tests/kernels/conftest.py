"""Tests of kernels leave the user's cache alone, and their machine code is optimised as it is for users."""

from __future__ import annotations

import pytest

from coadjoint.kernels.run.machine import processor


@pytest.fixture(autouse=True, scope="package")
def _as_for_users(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COADJOINT_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("COADJOINT_OPTIMIZE", "1")
        processor.cache_clear()
        yield
    processor.cache_clear()
