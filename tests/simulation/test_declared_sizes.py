"""Sizes that a file declares are compared with what it can hold before memory is taken."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import io
import json
import sqlite3
import struct
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

import coadjoint as co
from coadjoint import csv_tables, sealed
from coadjoint.errors import ArgumentError, CoadjointError, FileError
from coadjoint.plotting import meshes
from coadjoint.plotting.meshes import read_mesh
from coadjoint.simulation import configuration
from coadjoint.simulation.saved import SavedRun
from coadjoint_vehicles.hydrodynamics import capytaine_added_mass, wamit_added_mass
from coadjoint_vehicles.logs.bags.mcap_file import read_mcap
from coadjoint_vehicles.logs.bags.sqlite_file import read_sqlite
from coadjoint_vehicles.water import Bottom
from made_runs import dataset

HUGE = 400_000_000
"""Numbers of 3.2 GB in all."""


def hdf5(path: Path, kind: str) -> Path:
    """A small netCDF 4 file of 3 GB."""
    with h5py.File(path, "w") as file:
        file.attrs["card"] = "a card"
        if kind == "empty":
            file.create_dataset("time", (HUGE,), "f8")
        elif kind == "chunk":
            file.create_dataset("time", (1,), "f8", chunks=(HUGE,), maxshape=(None,))
        elif kind == "small kinds":
            file.create_dataset("time", (HUGE,), "i1")
        elif kind == "many":
            for number in range(40):
                file.create_dataset(f"x{number}", (HUGE // 40,), "f8")
        elif kind == "group":
            file.create_group("a").create_group("b").create_dataset("time", (HUGE,), "f8")
        elif kind == "texts":
            text = file.create_dataset("time", (60,), h5py.string_dtype())
            text[0] = "x" * 4_000_000
            for number in range(1, 60):  # the same text, again and again
                text[number] = text[0]
    return path


@pytest.mark.parametrize("kind", ["empty", "chunk", "small kinds", "many", "group"])
def test_a_sealed_file_that_declares_gigabytes_is_refused_before_it_is_read(tmp_path, kind):
    file = hdf5(tmp_path / "x.nc", kind)
    sealed.seal(file)
    assert sealed.sealed(file) is True and file.stat().st_size < 40_000
    with pytest.raises(FileError, match=r"declares [0-9.]+ GB of numbers, but has [0-9,]+ bytes"):
        co.load(file)


@pytest.mark.parametrize("kind", ["link", "external", "virtual", "filters", "many texts", "attribute"])
def test_a_sealed_file_that_is_more_than_plain_numbers_is_read_in_a_child(tmp_path, monkeypatch, kind):
    file, other = tmp_path / "x.nc", hdf5(tmp_path / "other.nc", "nothing")
    with h5py.File(file, "w") as opened:
        if kind == "link":
            opened["time"] = h5py.ExternalLink(str(other), "/")
        elif kind == "external":
            opened.create_dataset("time", (3,), "f8", external=[(str(other), 0, h5py.h5f.UNLIMITED)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout((3,), "f8")
            layout[:] = h5py.VirtualSource(str(other), "time", (3,))
            opened.create_virtual_dataset("time", layout)
        elif kind == "filters":
            opened.create_dataset("time", data=np.zeros(1000), compression="gzip")
        elif kind == "attribute":
            opened.attrs.create("names", ["x"] * 1000, dtype=h5py.string_dtype())
        else:
            opened.create_dataset("time", data=["x"] * 1000, dtype=h5py.string_dtype())
    sealed.seal(file)
    asked = []
    monkeypatch.setattr(sealed, "tried", asked.append)
    assert not sealed.readable(file) and asked == [file]


def test_a_file_of_a_run_is_plain_and_needs_no_child(tmp_path):
    made = dataset()
    made.attrs["card"] = "a card"
    assert sealed.plain(SavedRun(made).save(tmp_path / "run.nc"))


def test_an_empty_file_can_be_sealed_and_a_shorter_one_than_a_seal_has_none(tmp_path):
    file = tmp_path / "a"
    file.write_bytes(b"")
    assert sealed.sealed(file) is None
    sealed.seal(file)
    assert sealed.sealed(file) is True
    content = file.read_bytes()
    file.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert sealed.sealed(file) is False
    file.write_bytes(content[1:])
    assert sealed.sealed(file) is None


def child(tmp_path: Path, monkeypatch, instead: str) -> Path:
    """A file of others, whose child does something else in place of reading it."""
    text = Path(sealed.__file__).read_text(encoding="utf-8")
    reading = 'xarray.open_dataset(path, engine="h5netcdf").load()'
    assert text.count(reading) == 1
    script = tmp_path / "child.py"
    script.write_text(
        text.replace(reading, instead).replace("import xarray\n", "import h5py, time\n"), encoding="utf-8"
    )
    monkeypatch.setattr(sealed, "__file__", str(script))
    return hdf5(tmp_path / "x.nc", "nothing")


def test_a_child_that_waits_longer_than_its_processor_time_has_still_read_the_file(tmp_path, monkeypatch):
    file = child(tmp_path, monkeypatch, "time.sleep(0.4)")
    monkeypatch.setattr(sealed, "SECONDS", 0.05)
    assert sealed.readable(file)


@pytest.mark.parametrize(
    "code", ["bytearray(10**9)", "os.abort()", pytest.param("while True: pass", marks=pytest.mark.long)]
)
def test_a_child_that_takes_too_much_memory_or_processor_time_has_not(tmp_path, monkeypatch, code):
    file = child(tmp_path, monkeypatch, code)
    monkeypatch.setattr(sealed, "SECONDS", 0.05)
    assert not sealed.readable(file)


def test_a_child_that_is_waited_for_in_vain_says_so(tmp_path, monkeypatch):
    file = child(tmp_path, monkeypatch, "time.sleep(60)")
    monkeypatch.setattr(sealed, "SECONDS", 0.05)
    monkeypatch.setattr(sealed, "PATIENCE", 0.05)
    with pytest.raises(FileError, match="was not read within"):
        sealed.readable(file)


def test_files_of_coefficients_and_bottoms_that_declare_gigabytes_are_refused(tmp_path):
    file = hdf5(tmp_path / "x.nc", "empty")
    with pytest.raises(FileError, match=r"declares 3\.2 GB"):
        Bottom.from_netcdf(file)
    sealed.seal(file)
    with pytest.raises(FileError, match=r"declares 3\.2 GB"):
        capytaine_added_mass(file, axes="z_up")
    text = tmp_path / "x.1"
    text.write_bytes(b"-1 1 1 1.0\n" * 1_600_000)
    with pytest.raises(FileError, match="larger than the 16 MB"):
        wamit_added_mass(text, length=1, fluid_density=1000, axes="z_up")


def netcdf3(path: Path, variables: int, numbers: int) -> Path:
    """A netCDF 3 file of bytes that all its variables are, each of all of them."""
    names = [f"x{number:04d}" for number in range(variables)]
    head = b"CDF\x01" + struct.pack(">5I", 0, 10, 1, 1, ord("n") << 24) + struct.pack(">3I", numbers, 0, 0)
    head += struct.pack(">2I", 11, variables)
    begin = len(head) + 40 * variables
    for name in names:
        head += struct.pack(">I8s", 5, name.encode()) + struct.pack(">2I", 1, 0)
        head += struct.pack(">5I", 0, 0, 1, numbers, begin)
    path.write_bytes(head + bytes(numbers))
    return path


def test_variables_of_a_netcdf_3_file_that_are_the_same_bytes_are_refused(tmp_path, monkeypatch):
    import scipy.io

    file = netcdf3(tmp_path / "x.nc", 30, 100_000)
    with scipy.io.netcdf_file(file, mmap=False) as opened:
        assert {one.data.size for one in opened.variables.values()} == {100_000} and len(opened.variables) == 30
    assert sealed.engine_of(file) == "scipy"
    monkeypatch.setattr(sealed, "LEAST", 1_000_000)
    for reading in (lambda: capytaine_added_mass(file, axes="z_up"), lambda: Bottom.from_netcdf(file)):
        with pytest.raises(FileError, match=r"declares 0\.024 GB of numbers, but has 101,244 bytes"):
            reading()


def test_rows_of_a_bottom_that_are_no_grid_take_no_memory_of_one(tmp_path, monkeypatch):
    file = tmp_path / "x.csv"
    file.write_text("north,east,depth\n" + "".join(f"{i},{i},5\n" for i in range(3000)))
    full, made = np.full, []
    monkeypatch.setattr(np, "full", lambda shape, *rest: made.append(np.prod(shape)) or full(shape, *rest))
    with pytest.raises(FileError, match="one row for each of 3000 × 3000 nodes of a grid, but has 3000 rows"):
        Bottom.from_csv(file)
    assert max(made) == 3000


def tiff(path: Path, strip: bytes, rows: int, width: int = 100, compression: int = 8) -> Path:
    """A GeoTIFF of one strip of so many rows, whatever the strip holds."""
    values: list[tuple[int, str, tuple[float, ...]]] = [
        (256, "I", (width,)), (257, "I", (rows,)), (258, "H", (64,)), (259, "H", (compression,)), (262, "H", (1,)),
        (273, "I", (8,)), (277, "H", (1,)), (278, "I", (rows,)), (279, "I", (len(strip),)), (339, "H", (3,)),
        (33550, "d", (1.0, 1.0, 0.0)), (33922, "d", (0.0,) * 6), (34735, "H", (1, 1, 0, 1, 1024, 0, 1, 1)),
    ]  # fmt: skip
    start = 8 + len(strip)
    entries, more = b"", b""
    behind = start + 2 + 12 * len(values) + 4
    for code, kind, held in values:
        data = struct.pack(f"<{len(held)}{kind}", *held)
        field = data.ljust(4, b"\0") if len(data) <= 4 else struct.pack("<I", behind + len(more))
        more += data if len(data) > 4 else b""
        entries += struct.pack("<HHI", code, {"H": 3, "I": 4, "d": 12}[kind], len(held)) + field
    head = struct.pack("<2sHI", b"II", 42, start)
    path.write_bytes(head + strip + struct.pack("<H", len(values)) + entries + b"\0" * 4 + more)
    return path


def test_a_strip_of_a_geotiff_that_unpacks_to_more_than_its_pixels_is_refused(tmp_path):
    pytest.importorskip("tifffile")
    good = tiff(tmp_path / "good.tif", zlib.compress(np.full(1000, 7.0).tobytes()), 10)
    assert np.all(Bottom.from_geotiff(good, positive="down").depth == 7)
    bomb = tiff(tmp_path / "bomb.tif", zlib.compress(bytes(50_000_000)), 10)
    with pytest.raises(FileError, match="unpacks to more than its 8,000 bytes"):
        Bottom.from_geotiff(bomb)
    with pytest.raises(FileError, match=r"is compressed by .*JPEG2000.*, which is not read"):
        Bottom.from_geotiff(tiff(tmp_path / "x.tif", bytes(100), 10, compression=34712))
    content, more = bytearray(good.read_bytes()), struct.pack("<HHHII", 1, 254, 4, 1, 1)
    (start,) = struct.unpack_from("<I", content, 4)
    struct.pack_into("<I", content, start + 2 + 12 * 13, len(content))
    for number in range(1, 102):  # pictures of one tag, each of which names the next
        content += more + struct.pack("<I", len(content) + 18 if number < 101 else 0)
    good.write_bytes(content)
    with pytest.raises(FileError, match="has 102 pictures, more than 100"):
        Bottom.from_geotiff(good)
    wide = tiff(tmp_path / "wide.tif", zlib.compress(bytes(8)), 30_000, 10_000)
    with pytest.raises(FileError, match=r"300,000,000 pixels, more than 4,000,000"):
        Bottom.from_geotiff(wide)


def archive(parts: dict[str, bytes], packed: int = zipfile.ZIP_STORED) -> bytes:
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", packed) as made:
        for name, content in parts.items():
            made.writestr(f"{name}.npy", content)
    return body.getvalue() + hashlib.sha256(body.getbuffer()).digest()


def npy(shape: tuple[int, ...], content: bytes, kind: str = "<f8") -> bytes:
    """An array that declares a shape, with whatever bytes behind it."""
    made = io.BytesIO()
    np.lib.format.write_array_header_1_0(made, {"descr": kind, "fortran_order": False, "shape": shape})
    return made.getvalue() + content


def test_arrays_of_a_checkpoint_are_as_large_as_they_declare(tmp_path):
    file = tmp_path / "checkpoint.npz"
    header = npy((2,), b"{}", "|u1")
    file.write_bytes(archive({"header": header, "array/x": npy((2,), bytes(16))}))
    assert configuration.unpacked(file)[1]["x"].shape == (2,)
    for parts, packed in (
        ({"header": header, "array/x": npy((HUGE,), bytes(16))}, zipfile.ZIP_STORED),
        ({"header": header, "array/x": npy((1_000_000,), bytes(8_000_000))}, zipfile.ZIP_DEFLATED),
        ({"header": header, "array/x": npy((1,), bytes(8), "|O")}, zipfile.ZIP_STORED),
        ({"header": header, "array/x": b"no array"}, zipfile.ZIP_STORED),
        ({"array/x": npy((1,), bytes(8))}, zipfile.ZIP_STORED),
    ):
        file.write_bytes(archive(parts, packed))
        with pytest.raises(FileError, match="is damaged"):
            configuration.unpacked(file)


def test_tables_of_more_lines_or_cells_than_fit_in_memory_are_refused(tmp_path, monkeypatch):
    file = tmp_path / "x.csv"
    monkeypatch.setattr(csv_tables, "MOST_LINES", 1000)
    monkeypatch.setattr(csv_tables, "MOST_CELLS", 5000)
    for content, words in (
        ("a\n" + "\n" * 1000, "1,001 lines, more than 1,000"),
        ("a\n" + "\x1c" * 1000, "1,001 lines"),
        ("a,b\n" + "1," * 6000, "6,002 cells, more than 5,000"),
    ):
        file.write_text(content)
        with pytest.raises(FileError, match=words):
            csv_tables.read_sheet(file)


def test_messages_that_unpack_to_many_times_the_file_are_refused(tmp_path, monkeypatch):
    zstandard, decompressing = pytest.importorskip("zstandard"), "coadjoint_vehicles.logs.bags.decompressing"
    pytest.importorskip("mcap")
    monkeypatch.setattr(f"{decompressing}.LARGEST_CHUNK", 1_000_000)

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(content)) + content

    schema = record(3, struct.pack("<H", 1) + text("a/B") + text("ros2msg") + text("float64 x"))
    channel = record(4, struct.pack("<HH", 1, 1) + text("/a") + text("cdr") + text(""))
    plain = record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + bytes(3_000_000))
    packed = zstandard.ZstdCompressor().compress(plain)
    chunk = record(
        6, struct.pack("<QQQI", 0, 0, len(plain), 0) + text("zstd") + struct.pack("<Q", len(packed)) + packed
    )
    other = record(9, np.random.default_rng(1).bytes(6000))
    magic, file = b"\x89MCAP0\r\n", tmp_path / "x.mcap"
    file.write_bytes(magic + other + schema + channel + chunk + record(15, bytes(4)) + magic)
    assert read_mcap(file, lambda *_: False).topics() == {"/a": ("a/B", 0)}
    with pytest.raises(FileError, match="more than 50 times the file"):
        read_mcap(file, lambda *_: True)


@pytest.mark.parametrize("table", ["topics", "messages"])
def test_a_database_with_computed_columns_is_no_bag(tmp_path, table):
    file = tmp_path / "x.db3"
    columns = {"topics": "id, name, type, serialization_format", "messages": "id, topic_id, timestamp, data"}
    columns[table] += ", more BLOB AS (zeroblob(900000000))"
    base = sqlite3.connect(file)
    for name, held in columns.items():
        base.execute(f"CREATE TABLE {name}({held})")
    base.commit()
    base.close()
    with pytest.raises(FileError, match=f"its table `{table}` has columns that are computed"):
        read_sqlite(file, lambda *_: True)


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        ({"nodes": [{"children": [1, 1]}, {"mesh": 0}]}, FileError, "is damaged"),
        ({"nodes": [{"children": [0]}]}, FileError, "is damaged"),
        ({"bufferViews": [{"buffer": 0, "byteStride": 0}]}, FileError, "is damaged"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 4_000}]}, ArgumentError, "far more than 100"),
    ],
    ids=["a node twice", "a circle", "rows that overlap", "a piece again and again"],
)
def test_a_mesh_that_repeats_itself_is_refused(tmp_path, monkeypatch, change, kind, words):
    monkeypatch.setattr(meshes, "MOST", 100)
    held = {
        "buffers": [{"uri": f"data:,{base64.b64encode(np.eye(3, dtype='<f4').tobytes()).decode()}"}],
        "bufferViews": [{"buffer": 0}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    file = tmp_path / "x.gltf"
    file.write_text(json.dumps(held))
    assert len(read_mesh(file)["faces"]) == 3
    file.write_text(json.dumps(held | change))
    with pytest.raises(kind, match=words):
        read_mesh(file)


def test_a_mesh_whose_buffers_are_one_file_again_and_again_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "LARGEST", 1000)
    monkeypatch.setattr(meshes._content, "__defaults__", (1000,))
    (tmp_path / "x.bin").write_bytes(bytes(300))
    file = tmp_path / "x.gltf"
    for count, words in ((3, "has no triangles"), (4, "with all its parts")):
        file.write_text(json.dumps({"buffers": [{"uri": "x.bin"}] * count, "nodes": []}))
        with pytest.raises(FileError, match=words):
            read_mesh(file)


def test_files_that_are_too_large_for_their_kind_are_refused(tmp_path, monkeypatch):
    mesh, folder = tmp_path / "x.stl", tmp_path / "run"
    folder.mkdir()
    for file, size in ((mesh, 33_000_000), (folder / "manifest.json", 1 << 27), (folder / "summary.json", 1 << 27)):
        with file.open("wb") as opened:
            opened.truncate(size)  # of holes, which take no room on the disk
    from coadjoint.cli.commands import Reproduce
    from coadjoint.cli.results_folder import summary
    from coadjoint.manifest import Manifest
    from coadjoint.report.folder import held
    from coadjoint.sweeps.task import read

    monkeypatch.setattr("coadjoint.report.reproduce.reproduce", lambda *_, **__: None)  # the folder holds it
    other = tmp_path / "other"
    other.mkdir()
    Manifest(other, {"kind": "results", "inputs": {}}).write()
    with (other / "run.toml").open("wb") as opened:
        opened.truncate(1 << 27)
    for reading in (
        lambda: read_mesh(mesh), lambda: Manifest.read(folder), lambda: summary(folder), lambda: read(str(other), ""),
        lambda: held(other).__enter__(), Reproduce(folder, json=True),
    ):  # fmt: skip
        with pytest.raises(CoadjointError, match=r"larger than|too large"):
            reading()


def page_of(kind: int, children: int, cells: list[bytes]) -> bytes:
    """A page of SQLite's trees: 13 is a leaf, 5 has children, the last of which stands in its head."""
    head, end, places = 8 if kind == 13 else 12, 4096, []
    body = bytearray(4096)
    for cell in cells:
        end -= len(cell)
        body[end : end + len(cell)] = cell
        places.append(end)
    struct.pack_into(">BHHHB", body, 0, kind, 0, len(cells), end, 0)
    struct.pack_into(">I", body, 8, children)
    struct.pack_into(f">{len(cells)}H", body, head, *places)
    return bytes(body)


@pytest.mark.parametrize(("topic", "words"), [(1, "more bytes than the file"), (2, "interrupted")])
def test_a_database_whose_pages_are_parts_of_many_others_is_refused(tmp_path, topic, words):
    """A table of 53 kB with 101⁹ · 40 messages without bytes, of a topic that is wanted, or of none."""
    file = tmp_path / "x.db3"
    with contextlib.closing(sqlite3.connect(file)) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        base.execute("INSERT INTO topics VALUES(1, '/imu', 'sensor_msgs/msg/Imu', 'cdr')")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        base.commit()
        ((root,),) = base.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'")
    row = bytes([5, 0, 1, 1, 12, topic, 5])
    pages = [file.read_bytes(), page_of(13, 0, [bytes([len(row), i]) + row for i in range(1, 41)])]
    first = len(pages[0]) // 4096 + 1
    trees = [page_of(5, first + k, [struct.pack(">IB", first + k, i) for i in range(1, 101)]) for k in range(9)]
    content = bytearray(b"".join([*pages, *trees[:-1]]))
    content[(root - 1) * 4096 : root * 4096] = trees[-1]
    struct.pack_into(">I", content, 28, len(content) // 4096)
    file.write_bytes(content)
    with pytest.raises(FileError, match=words):
        read_sqlite(file, lambda *_: True)
