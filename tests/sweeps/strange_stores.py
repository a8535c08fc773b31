"""Folders of sweeps as a stranger or a broken disk may leave them.

`made` writes a small folder as a sweep leaves it, without running anything. `hostile` changes it at random and lets
the manifest fit again, as somebody would who wants what is read to do harm; `damaged` changes its files alone.
"""

from __future__ import annotations

import json
import os
import pickle
import random
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from coadjoint.manifest import MANIFEST, Manifest, checksum
from coadjoint.report.folder import RUN_FILE, SUMMARY
from coadjoint.sealed import seal
from coadjoint.sweeps import store

MEMBERS, SIZE = 5, 2
VALUES: dict[str, np.ndarray] = {
    "parameters.mass": np.linspace(4, 6, MEMBERS),
    "code": np.array([0, 0, 2, 0, 0]),
    "final_xi": np.arange(15.0).reshape(MEMBERS, 3),
}
DIMS = {"parameters.mass": ("member",), "code": ("member",), "final_xi": ("member", "algebra")}
ATTRIBUTES: dict[str, dict[str, Any]] = {"parameters.mass": {"swept": 1}, "code": {}, "final_xi": {"units": "rad/s"}}


def made(folder: Path) -> Path:
    """A finished sweep of five members in three tasks."""
    folder.mkdir()
    facts = {"kind": "results", "complete": True, "inputs": {}}
    manifest = Manifest(folder, {**facts, "sweep": {"digest": "0", "members": MEMBERS, "whole": True}})
    kinds = {name: "int64" if name in store.WHOLE else "float64" for name in VALUES}
    layout = {name: (DIMS[name], v.shape, kinds[name], ATTRIBUTES[name]) for name, v in VALUES.items()}
    store.lay_out(manifest, layout, SIZE, {"system": "top"})
    for number in range(-(-MEMBERS // SIZE)):
        for name, values in VALUES.items():
            store._write_chunk(folder, name, number, SIZE, values[number * SIZE : (number + 1) * SIZE])
    table = xarray.Dataset({"final_xi": (("statistic", "algebra"), np.ones((2, 3)))}, {"statistic": ["mean", "std"]})
    table.to_netcdf(folder / store.STATISTICS, engine="h5netcdf")
    seal(folder / store.STATISTICS)
    words = dict.fromkeys(("system", "method", "sampling", "card"), "top")
    numbers = dict.fromkeys(("members", "tasks", "members_of_a_task", "finished", "events", "steps"), 5)
    times = dict.fromkeys(("dt", "seconds", "task_seconds"), 0.1)
    lists = {"numbers": ["parameters.mass"], "figures": [], "failures": {"not finite": 1}}
    empty = {"warnings": {}, "refusals": {}, "versions": {}}
    (folder / SUMMARY).write_text(json.dumps({**words, **numbers, **times, **lists, **empty}))
    (folder / RUN_FILE).write_text("[sweep]\n")
    entered(manifest)
    return folder


def entered(manifest: Manifest) -> None:
    """Let a manifest fit the files that are there."""
    manifest.files.clear()
    for path in sorted(manifest.folder.rglob("*")):
        if path.is_file() and path.name != MANIFEST:
            manifest.enter(path.relative_to(manifest.folder).as_posix())
    manifest.write()


class Mark:
    """What writes a file when it is unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


CODECS = [
    "gzip", "zstd", "blosc", "transpose", "sharding_indexed", "vlen-utf8", "vlen-bytes", "numcodecs.pickle", "pickle",
    "numcodecs.zlib", "numcodecs.delta", "numcodecs.json2", "https://codec.example/pickle", "nothing", "", "bytes",
]  # fmt: skip
STRANGE: list[Any] = [
    None, True, -1, 0, 1, 2, 7, 10**9, 10**15, 10**400, 1.5, float("nan"), float("inf"), -float("inf"), "", "x", "..",
    "../../manifest.json", "/etc/passwd", "\x1b]0;title\x07", "a\x00b", "é\u2028", "x" * 5000, [], {}, [[]],
    [1], [-1], ["x"],
    {"name": "x"}, {"name": []}, [None], {"configuration": None}, [2**63], [0, 0, 0], "days since 1970-01-01", "|O8",
    "float16", "string", "datetime64", [{"name": "bytes"}], {"a": {"b": {"c": [1, {"d": None}]}}},
]  # fmt: skip


def hostile(folder: Path, seed: int, mark: Path) -> str:
    """Change a folder that `made` left, and let the manifest fit; what was changed."""
    r = random.Random(seed)
    kinds = [_codec, _version_2, _json_place, _json_place, _json_place, _chunk, _order, _summary, _statistics, _nested]
    kind = [*kinds, _manifest, _link][seed % (len(kinds) + 2)]
    told = kind(r, folder, mark)
    if kind is not _manifest:
        entered(Manifest.read(folder))
    if kind is _link:
        _put_link(r, folder)
    return f"{kind.__name__}: {told}"


def _change(path: Path, change: Any) -> None:
    found = json.loads(path.read_text())
    change(found)
    path.write_text(json.dumps(found))


def _metadata(r: random.Random, folder: Path) -> Path:
    return r.choice(sorted((folder / store.MEMBERS).rglob("zarr.json")))


def _codec(r: random.Random, folder: Path, mark: Path) -> str:
    name = r.choice(sorted(VALUES))
    codec = {"name": r.choice(CODECS), "configuration": r.choice([{}, {"id": "pickle"}, {"level": 5}, {"order": [0]}])}
    places = r.choice([slice(0, 0), slice(2, 2), slice(0, 1), slice(1, 2), slice(0, 2)])
    _change(folder / store.MEMBERS / name / "zarr.json", lambda found: found["codecs"].__setitem__(places, [codec]))
    return f"{name} {codec}"


def _version_2(r: random.Random, folder: Path, mark: Path) -> str:
    """An array of version 2 whose chunks are pickles, by a filter or as objects."""
    place = folder / store.MEMBERS
    name = r.choice(sorted(VALUES))
    pickled = pickle.dumps(np.array([Mark(mark)] * SIZE, dtype=object))
    own = {"zarr_format": 2, "shape": [MEMBERS], "chunks": [SIZE], "fill_value": None, "order": "C", "compressor": None}
    filters = r.choice([[{"id": "pickle"}], [{"id": "pickle", "protocol": 5}, {"id": "delta"}]])
    (place / name / ".zarray").write_text(json.dumps({**own, "dtype": r.choice(["|O", "<f8"]), "filters": filters}))
    for number in range(3):
        for chunk in (str(number), f"c.{number}"):
            (place / name / chunk).write_bytes(pickled)
    if r.random() < 0.7:
        (place / name / "zarr.json").unlink()
    if r.random() < 0.5:
        (place / ".zgroup").write_text('{"zarr_format": 2}')
        (place / ".zattrs").write_text(json.dumps({"order": sorted(VALUES)}))
        (place / "zarr.json").unlink()
    return name


def _json_place(r: random.Random, folder: Path, mark: Path) -> str:
    path = _metadata(r, folder)
    _change(path, lambda found: _replace(r, found))
    return path.read_text()


def _replace(r: random.Random, found: Any) -> None:
    """Another value somewhere in a tree of JSON."""
    while True:
        keys = list(found) if isinstance(found, dict) else list(range(len(found)))
        key = r.choice(keys)
        if isinstance(found[key], (dict, list)) and found[key] and r.random() < 0.7:
            found = found[key]
            continue
        if isinstance(found, dict) and r.random() < 0.2:
            del found[key]
        else:
            found[r.choice([key, "x"]) if isinstance(found, dict) else key] = r.choice(STRANGE)
        return


def _chunk(r: random.Random, folder: Path, mark: Path) -> str:
    path = r.choice(sorted((folder / store.MEMBERS).rglob("c.*")))
    data = path.read_bytes()
    pickled = pickle.dumps(Mark(mark))
    other = r.choice([b"", b"\x00", pickled, r.randbytes(len(data)), data[:-1], data * 3, r.randbytes(len(data) - 4)])
    path.write_bytes(other + (checksum(other) if r.random() < 0.5 else b""))
    return path.name


def _order(r: random.Random, folder: Path, mark: Path) -> str:
    names = sorted(VALUES)
    wrong = [
        ["../.."],
        [*names, names[0]],
        [*names, "nothing"],
        "code",
        5,
        None,
        [1],
        [names],
        {},
        ["code/../code"],
        [""],
    ]
    order = r.choice(wrong)
    _change(folder / store.MEMBERS / "zarr.json", lambda found: found["attributes"].__setitem__("order", order))
    return str(order)


def _summary(r: random.Random, folder: Path, mark: Path) -> str:
    path = folder / SUMMARY
    if r.random() < 0.3:
        path.write_bytes(
            r.choice([b"", b"[" * 10**5, b"null", b"\xff\xfe", b'{"members": 1e999}', pickle.dumps(Mark(mark))])
        )
    else:
        _change(path, lambda found: _replace(r, found))
    return path.read_bytes()[:100].decode("latin-1")


def _statistics(r: random.Random, folder: Path, mark: Path) -> str:
    path = folder / store.STATISTICS
    data = path.read_bytes()[: -(16 + 32)]
    at = r.randrange(len(data))
    wrong = [
        b"",
        pickle.dumps(Mark(mark)),
        b"CDF\x01" + r.randbytes(50),
        data[:at],
        data[:at] + r.randbytes(8) + data[at + 8 :],
    ]
    path.write_bytes(r.choice(wrong))
    seal(path)
    return str(at)


def _nested(r: random.Random, folder: Path, mark: Path) -> str:
    path = _metadata(r, folder)
    deep = r.choice(
        ["[" * 10**5, '{"a":' * 2000 + "1" + "}" * 2000, '{"zarr_format": 3, "node_type": "group", "attributes": {}}']
    )
    path.write_text(deep)
    return path.name


def _manifest(r: random.Random, folder: Path, mark: Path) -> str:
    found = Manifest.read(folder)
    table = {"facts": found.facts, "files": found.files}
    _replace(r, table)
    facts = table.get("facts", {})
    body = f'{{\n"facts": {json.dumps(facts)},\n"files": {json.dumps(table.get("files"))},\n"sha256": "'.encode()
    import hashlib

    (folder / MANIFEST).write_bytes(body + hashlib.sha256(body).hexdigest().encode() + b'"\n}\n')
    return body.decode()


def _link(r: random.Random, folder: Path, mark: Path) -> str:
    return ""


def _put_link(r: random.Random, folder: Path) -> None:
    """A link, a folder or a pipe in the place of a file."""
    path = r.choice([path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != MANIFEST])
    path.unlink()
    r.choice(
        [lambda: path.symlink_to("/dev/zero"), lambda: path.symlink_to(path), path.mkdir, lambda: os.mkfifo(path)]
    )()


def damaged(folder: Path, seed: int) -> str:
    """Damage a folder without letting the manifest know; what was done."""
    r = random.Random(seed)
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    path = files[seed % len(files)]
    data = path.read_bytes()
    at = r.randrange(max(len(data), 1))
    kinds = ["flip", "delete", "truncate", "zero", "append", "swap", "empty", "rename"]
    kind = kinds[(seed // len(files)) % len(kinds)]
    other = r.choice([one for one in files if one != path])
    if kind == "delete":
        path.unlink()
    elif kind == "rename":
        path.rename(path.with_name(f"{path.name}0"))
    elif kind == "swap":
        path.write_bytes(other.read_bytes())
    else:
        flipped = bytes([(data[at] if data else 0) ^ (1 << r.randrange(8))])
        path.write_bytes({
            "flip": data[:at] + flipped + data[at + 1 :], "truncate": data[:at], "empty": b"",
            "append": data + r.randbytes(5),
            "zero": data[:at] + b"\x00" * len(data[at : at + 64]) + data[at + 64 :],
        }[kind])  # fmt: skip
    return f"{kind} {path.relative_to(folder)} {at}"


def copied(source: Path, target: Path) -> Path:
    """Another folder like this one."""
    return Path(shutil.copytree(source, target, symlinks=True))
