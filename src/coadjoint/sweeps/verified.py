"""Files of a sweep's store as zarr and xarray read them: only those that its manifest lists, and only if unchanged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from zarr.storage import LocalStore

from coadjoint.errors import FileError
from coadjoint.manifest import DAMAGED, Manifest, sums_up
from coadjoint.simulation.zarr_reader import arrays


class Verified(LocalStore):
    """Files of the folder `place`, as the manifest lists them; raises FileError that names a file that differs.

    whole: if true, every chunk was written; otherwise a chunk that the manifest lacks held only its fill value.
    """

    def __init__(self, root: Path | str, *, manifest: Manifest, place: str, whole: bool = True, **options: Any):
        super().__init__(root, **options)
        self.manifest, self.place, self.whole = manifest, place, whole

    def with_read_only(self, read_only: bool = False) -> Verified:
        own = {"manifest": self.manifest, "place": self.place, "whole": self.whole}
        return Verified(self.root, read_only=read_only, **own)

    async def get(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, await super().get(key, *rest, **options)) if self._is_there(key) else None

    def get_sync(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, super().get_sync(key, *rest, **options)) if self._is_there(key) else None

    def _is_there(self, key: str) -> bool:
        """Whether the manifest has a file, which then must be a file of its size: pipes and devices are not read."""
        name = f"{self.place}/{key}"
        if name in self.manifest.files:
            self.manifest.require_size(name)
            return True
        if (self.root / key).exists() or (self.whole and "/c." in key):
            raise FileError(f"The file {self.root / key} is not among those of the manifest: {DAMAGED}.")
        return False

    def _checked(self, key: str, found: Any) -> Any:
        data = None if found is None else found.to_bytes()
        self.manifest.require(f"{self.place}/{key}", data)
        if data is not None and "/c." in key and not sums_up(data):
            raise FileError(f"The file {self.root / key} does not have the checksum with which it ends: {DAMAGED}.")
        return found


def verified(manifest: Manifest, place: str, whole: bool = True) -> Verified:
    """The store of the folder `place`; raises FileError unless all of it is plain, so that no other codec is run."""
    arrays(manifest, place)
    return Verified(manifest.folder / place, manifest=manifest, place=place, whole=whole, read_only=True)
