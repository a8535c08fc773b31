"""Tests leave the user's cache alone."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True, scope="session")
def _own_store(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COADJOINT_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
