"""Small writers of every format that is read, so that the tests need no files of others."""

from __future__ import annotations

import gzip
import io
import struct
from pathlib import Path

import numpy as np

NAMES = [
    *("ply ascii", "ply little", "ply big", "ply element before", "pcd ascii", "pcd binary", "pcd compressed", "xyz", "csv", "pts"),
    *("semicolon", "stl binary", "stl ascii", "obj", "off", "off binary", "npy", "npz", "las", "las 1.4", "laz", "e57", "gzip"),
]
"""The samples that `every_format` makes."""

TYPES = {"f4": "float", "f8": "double", "i4": "int", "u1": "uchar", "i2": "short", "u2": "ushort", "i1": "char", "u4": "uint"}


def points(n: int = 12, seed: int = 0) -> np.ndarray:
    """Distinct points with coordinates that float32 holds exactly."""
    return np.random.default_rng(seed).integers(-4000, 4000, (n, 3)) / 16.0


def columns(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an .npz file, which is closed: a file left open fails whichever test runs when it is collected."""
    with np.load(path) as arrays:
        return dict(arrays)


def ply(xyz, order="<", kinds=("f8", "f8", "f8"), before=(), after=(), extra=(), comments=(), faces=True, newline="\n"):
    """PLY; `before` and `after` are (name, type) of scalar properties around x, y, z; `extra` elements precede the vertices."""
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    fields = [*before, *zip("xyz", kinds, strict=True), *after]
    lines = ["ply", f"format {kind} 1.0", *comments]
    for name, count, properties, _ in extra:
        lines += [f"element {name} {count}", *properties]
    lines += [f"element vertex {len(xyz)}", *(f"property {TYPES[k]} {name}" for name, k in fields)]
    if faces:
        lines += ["element face 2", "property list uchar int vertex_indices"]
    header = newline.join([*lines, "end_header", ""]).encode()
    body = b"".join(payload for *_, payload in extra)
    if order:
        rows = np.zeros(len(xyz), [(name, order + k) for name, k in fields])
        for axis, name in enumerate("xyz"):
            rows[name] = xyz[:, axis]
        body += rows.tobytes()
        if faces:
            body += struct.pack(order + "B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 3)
    else:
        pad_before, pad_after = "7 " * len(before), " 9" * len(after)
        body += "".join(f"{pad_before}{x!r} {y!r} {z!r}{pad_after}{newline}" for x, y, z in xyz.tolist()).encode()
        body += newline.join(["3 0 1 2", "4 0 1 2 3", ""]).encode() if faces else b""
    return header + body


def lzf(data: bytes) -> bytes:
    """Pack by LZF, simply: three equal bytes or more become a reference, the rest runs."""
    out, run, place, seen = bytearray(), bytearray(), 0, {}

    def flush():
        for start in range(0, len(run), 32):
            piece = run[start : start + 32]
            out.append(len(piece) - 1)
            out.extend(piece)
        run.clear()

    while place < len(data):
        key = data[place : place + 3]
        earlier = seen.get(key, -1)
        seen[key] = place
        if len(key) == 3 and earlier >= 0 and place - earlier <= 8191:
            length = 3
            while length < 264 and place + length < len(data) and data[earlier + length] == data[place + length]:
                length += 1
            flush()
            distance = place - earlier - 1
            if length - 2 < 7:
                out.append(((length - 2) << 5) | (distance >> 8))
            else:
                out += bytes([(7 << 5) | (distance >> 8), length - 2 - 7])
            out.append(distance & 255)
            place += length
        else:
            run.append(data[place])
            place += 1
    flush()
    return bytes(out)


def pcd(xyz, data="ascii", size=4, header=None, comment=True):
    """PCD with a colour before and a normal behind the coordinates."""
    fields = {"FIELDS": "rgb x y z normal", "SIZE": f"4 {size} {size} {size} 4", "TYPE": "U F F F F", "COUNT": "1 1 1 1 3"}
    fields |= {"WIDTH": str(len(xyz)), "HEIGHT": "1", "VIEWPOINT": "0 0 0 1 0 0 0", "POINTS": str(len(xyz)), **(header or {})}
    lines = ["# .PCD v0.7 - Point Cloud Data file format"] * comment + ["VERSION 0.7", *(f"{k} {v}" for k, v in fields.items() if v)]
    head = "\n".join([*lines, f"DATA {data}", ""]).encode()
    if data == "ascii":
        return head + "".join(f"255 {x!r} {y!r} {z!r} 0 0 1\n" for x, y, z in xyz.tolist()).encode()
    rows = np.zeros(len(xyz), [("rgb", "<u4"), ("x", f"<f{size}"), ("y", f"<f{size}"), ("z", f"<f{size}"), ("normal", "<f4", 3)])
    for axis, name in enumerate("xyz"):
        rows[name] = xyz[:, axis]
    if data == "binary":
        return head + rows.tobytes()
    columns = b"".join(np.ascontiguousarray(rows[name]).tobytes() for name in rows.dtype.names)
    packed = lzf(columns)
    return head + struct.pack("<2I", len(packed), len(columns)) + packed


def text(xyz, separator=" ", extra="", before=""):
    return (before + "".join(separator.join(map(repr, row)) + extra + "\n" for row in xyz.tolist())).encode()


def stl(xyz, name=b"made by hand"):
    """Binary STL of one triangle for every three points."""
    corners = xyz.reshape(-1, 9).astype("<f4")
    return name.ljust(80) + struct.pack("<I", len(corners)) + b"".join(bytes(12) + row.tobytes() + b"\0\0" for row in corners)


def stl_text(xyz):
    lines = ["solid part"]
    for triangle in xyz.reshape(-1, 3, 3).tolist():
        lines += ["facet normal 0 0 1", " outer loop", *(f"  vertex {x!r} {y!r} {z!r}" for x, y, z in triangle), " endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part", ""]).encode()


def obj(xyz):
    lines = ["# by hand", "mtllib a.mtl", "o part"]
    for x, y, z in xyz.tolist():
        lines += [f"v {x!r} {y!r} {z!r}", "vn 0 0 1"]
    return "\n".join([*lines, "f 1//1 2//2 3//3", ""]).encode()


def off(xyz, keyword="OFF", extra=""):
    rows = "".join(f"{x!r} {y!r} {z!r}{extra}\n" for x, y, z in xyz.tolist())
    return f"{keyword}\n# by hand\n{len(xyz)} 1 0\n{rows}3 0 1 2\n".encode()


def off_binary(xyz, keyword="OFF", width=3):
    rows = np.zeros((len(xyz), width), ">f4")
    rows[:, :3] = xyz
    return f"{keyword} BINARY\n".encode() + struct.pack(">3i", len(xyz), 0, 0) + rows.tobytes()


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    return stream.getvalue()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def las(xyz, scale=1 / 16, offset=(0.0, 0.0, 0.0), version=(1, 2), kind=0, vlrs=()):
    """LAS; `vlrs` are (user, number, content)."""
    records = b"".join(b"\0\0" + u.encode().ljust(16, b"\0") + struct.pack("<HH", n, len(c)) + bytes(32) + c for u, n, c in vlrs)
    length, size = {0: 20, 6: 30}[kind], 375 if version == (1, 4) else 227
    integers = np.round((xyz - offset) / scale).astype("<i4")
    header = (
        b"LASF"
        + bytes(20)
        + bytes(version)
        + bytes(68)
        + struct.pack("<HIIBHI", size, size + len(records), len(vlrs), kind, length, 0 if kind else len(xyz))
    )
    header = header.ljust(131, b"\0") + struct.pack("<6d", scale, scale, scale, *offset)
    header = header.ljust(247, b"\0") + (struct.pack("<Q", len(xyz)) if size == 375 else b"")
    return header.ljust(size, b"\0")[:size] + records + b"".join(row.tobytes().ljust(length, b"\0") for row in integers)


def laz(xyz, scale=1 / 16):
    import laspy

    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = np.full(3, scale), np.zeros(3)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    stream = io.BytesIO()
    cloud.write(stream, do_compress=True)
    return stream.getvalue()


def e57(path: Path, scans):
    """E57 of scans given as (points, invalid or None, rotation (w, x, y, z), translation)."""
    import pye57

    with pye57.E57(str(path), mode="w") as file:
        for xyz, invalid, rotation, translation in scans:
            data = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), np.ascontiguousarray(xyz.T), strict=True))
            if invalid is not None:
                data["cartesianInvalidState"] = np.asarray(invalid, np.int8)
            file.write_scan_raw(data, rotation=np.array(rotation, float), translation=np.array(translation, float))
    return path.read_bytes()


def every_format(folder: Path) -> dict[str, tuple[str, bytes]]:
    """A valid file of every format: name → (suffix, content)."""
    xyz = points()
    identity = (1.0, 0.0, 0.0, 0.0)
    extra = [("camera", 2, ["property list uchar float pose", "property int id"], struct.pack("<B2fiB1fi", 2, 1, 2, 5, 1, 3, 6))]
    return {
        "ply ascii": (".ply", ply(xyz, "")),
        "ply little": (".ply", ply(xyz, "<", after=[("red", "u1")], comments=["comment unit mm"])),
        "ply big": (".ply", ply(xyz, ">", kinds=("f4", "f8", "f4"))),
        "ply element before": (".ply", ply(xyz, "<", extra=extra)),
        "pcd ascii": (".pcd", pcd(xyz)),
        "pcd binary": (".pcd", pcd(xyz, "binary")),
        "pcd compressed": (".pcd", pcd(xyz, "binary_compressed")),
        "xyz": (".xyz", text(xyz)),
        "csv": (".csv", text(xyz, ",", before="x,y,z\n")),
        "pts": (".pts", text(xyz, extra=" 1 2 3 4", before=f"{len(xyz)}\n")),
        "semicolon": (".txt", text(xyz, ";").replace(b".", b",")),
        "stl binary": (".stl", stl(xyz)),
        "stl ascii": (".stl", stl_text(xyz)),
        "obj": (".obj", obj(xyz)),
        "off": (".off", off(xyz)),
        "off binary": (".off", off_binary(xyz)),
        "npy": (".npy", npy(xyz)),
        "npz": (".npz", npz(points=xyz, label=np.zeros(len(xyz), np.uint8))),
        "las": (".las", las(xyz)),
        "las 1.4": (
            ".las",
            las(xyz, version=(1, 4), kind=6, vlrs=[("LASF_Projection", 34735, struct.pack("<8H", 1, 1, 0, 1, 3076, 0, 1, 9002))]),
        ),
        "laz": (".laz", laz(xyz)),
        "e57": (".e57", e57(folder / "sample.e57", [(xyz, None, identity, (0, 0, 0))])),
        "gzip": (".xyz.gz", gzip.compress(text(xyz), mtime=0)),
    }
