"""What a file is that holds no points we read, told from its first bytes, so that the message can name it."""

from __future__ import annotations

import re

from scan2nurbs.io.source import Source

_MAGIC = (
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x89PNG\r\n", "a PNG picture"),
    (b"GIF8", "a GIF picture"),
    (b"II*\x00", "a TIFF picture"),
    (b"MM\x00*", "a TIFF picture"),
    (b"BM", "a BMP picture"),
    (b"RIFF", "a RIFF file (a picture, sound or film)"),
    (b"%PDF", "a PDF document"),
    (b"BZh", "a bzip2 archive; unpack it first"),
    (b"\xfd7zXZ\x00", "an xz archive; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive; unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive; unpack it first"),
    (b"Rar!", "a RAR archive; unpack it first"),
    (b"\x1f\x8b", "gzip inside gzip; unpack it first"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a Windows program"),
    (b"glTF", "a glTF model"),
    (b"Kaydara FBX", "an FBX model"),
    (b"3D Geometry File Format", "a Rhino model (3DM)"),
    (b"\x89HDF", "an HDF5 file"),
    (b"PAR1", "a Parquet table"),
    (b"SQLite format 3", "an SQLite database"),
    (b"\xd0\xcf\x11\xe0", "a Microsoft Office or SolidWorks file"),
    (b"version https://git-lfs.github.com", "a Git LFS pointer, not the file itself; fetch it with 'git lfs pull'"),
)
_TEXT = (
    (rb"ISO-10303-21", "a STEP file, which is a CAD model and not a scan"),
    (rb"(DBRep_DrawableShape|CASCADE Topology)", "a BREP file, which is a CAD model and not a scan"),
    (rb".{72}S\s*\d+\s", "an IGES file, which is a CAD model and not a scan"),
    (rb"# vtk DataFile", "a VTK file"),
    (rb"(<!doctype html|<html|<head|<body)", "a web page (HTML)"),
    (rb"<\?xml|<[a-z!]", "an XML document"),
    (rb"#VRML", "a VRML model"),
    (rb"0\r?\n\s*SECTION", "a DXF drawing"),
    (rb"\{\s*[\"}]|\[\s*\{", "a JSON document"),
    (rb"#!", "a script"),
    (rb"\$MeshFormat", "a Gmsh mesh"),
    (rb"%!PS", "a PostScript document"),
)
_TEXT_PATTERNS = tuple((re.compile(rb"\s*" + pattern, re.IGNORECASE), name) for pattern, name in _TEXT)
_IN_ZIP = (
    (".npy", None),
    ("3D/3dmodel.model", "a 3MF model"),
    ("xl/workbook.xml", "an Excel workbook; save it as CSV"),
    ("word/document.xml", "a Word document"),
    ("mimetype", "an OpenDocument file; save it as CSV"),
)


def name_foreign(source: Source) -> str | None:
    """Return what the file is, as in "a JPEG picture", if it is a known kind that holds no points we read; else None."""
    head = source.data[:4096]
    if head[:4] == b"PK\x03\x04" or head[:4] == b"PK\x05\x06":
        return _name_zip(source)
    body = head.removeprefix(b"\xef\xbb\xbf")
    for magic, name in _MAGIC:
        if body.startswith(magic):
            return name
    return next((name for pattern, name in _TEXT_PATTERNS if pattern.match(body)), None)


def is_npz(source: Source) -> bool:
    """Tell whether the file is a ZIP archive with arrays of NumPy's in it."""
    return source.data[:4] == b"PK\x03\x04" and _name_zip(source) is None


def _name_zip(source: Source) -> str | None:
    # The names stand in the directory at the end; reading it here would mean to trust it, finding them does not.
    for name, kind in _IN_ZIP:
        if source.data.find(name.encode()) >= 0:
            return kind
    return "a ZIP archive; unpack it first"
