"""NPY and NPZ, NumPy's formats; never unpickled. They state no unit, except an array ``unit`` in an NPZ file."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from scan2nurbs.errors import InputError
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source, unpacked_limit
from scan2nurbs.io.units import unit_of

_PREFERRED = ("points", "xyz", "vertices")
# What a ZIP library raises on damaged bytes: each of these was met in tests with mutated files.
_ZIP_TROUBLE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError, ValueError, KeyError, OverflowError)


@dataclass(frozen=True)
class _Header:
    """What the header of an array says, and how many bytes it takes."""

    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype
    size: int

    @property
    def is_points(self) -> bool:
        """Whether the array has rows of at least three numbers."""
        return self.dtype.kind in "fiu" and len(self.shape) == 2 and self.shape[1] >= 3


def read_npy(source: Source) -> Scan:
    """Read an (N, 3 or more) or organised (H, W, 3) array of numbers, or a structured one with fields x, y and z.

    Raises
    ------
    InputError
        If the header is damaged, the array is none of points, or is larger than the file.
    """
    array = _read_array(source, io.BytesIO(source.data[:]), len(source.data), "The array")
    points, notes = _as_points(source, array, "The array")
    return Scan(points, None, "NPY", notes)


def read_npz(source: Source) -> Scan:
    """Read the points of an NPZ file: the array "points", "xyz" or "vertices", or "x", "y" and "z", or the only (N, 3) array.

    Raises
    ------
    InputError
        If the archive is damaged or unpacks to far more than its size, or it is unclear which array holds the points.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(source.data[:])) as archive:
            return _read_archive(source, archive)
    except _ZIP_TROUBLE as error:
        raise source.fault(f"The NPZ archive is damaged: {error or type(error).__name__}.") from error


def _read_archive(source: Source, archive: zipfile.ZipFile) -> Scan:
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist() if info.filename.endswith(".npy")}
    limit = unpacked_limit(len(source.data))
    if sum(info.file_size for info in members.values()) > limit:
        raise source.fault(f"The NPZ archive declares more than {limit:,} unpacked bytes, far more than its size can hold.")

    def load(name: str) -> NDArray:
        with archive.open(members[name]) as stream:
            return _read_array(source, stream, members[name].file_size, f"The array '{name}'")

    def header(name: str) -> _Header:
        with archive.open(members[name]) as stream:
            return _read_header(source, stream, f"The array '{name}'")

    unit = None
    if "unit" in members and members["unit"].file_size < 4096:
        value = load("unit")
        unit = unit_of(str(value)) if value.shape == () and value.dtype.kind == "U" else None
    if not any(name in members for name in _PREFERRED) and all(axis in members for axis in "xyz"):
        columns = [load(axis) for axis in "xyz"]
        if any(column.ndim != 1 or column.dtype.kind not in "fiu" or column.shape != columns[0].shape for column in columns):
            raise source.fault("The arrays 'x', 'y' and 'z' of the NPZ archive must be one-dimensional numbers, equally many.")
        return Scan(np.stack(columns, axis=1).astype(np.float64), unit, "NPZ", ("The arrays 'x', 'y' and 'z' were read.",))
    name = _choose(source, list(members), header)
    points, notes = _as_points(source, load(name), f"The array '{name}'")
    return Scan(points, unit, "NPZ", (f"The array '{name}' was read.", *notes))


def _choose(source: Source, names: list[str], header: Callable[[str], _Header]) -> str:
    """Return the name of the array that holds the points."""
    for preferred in _PREFERRED:
        if preferred in names:
            return preferred
    candidates = [name for name in names if header(name).is_points and header(name).shape[1] == 3] if len(names) <= 1000 else []
    if not candidates and len(names) == 1:
        return names[0]
    if len(candidates) != 1:
        known = ", ".join(candidates or names[:12]) or "nothing"
        which = "several (N, 3) arrays" if candidates else "no (N, 3) array"
        raise source.fault(f"The NPZ archive holds {which} and none named 'points': {known}.")
    return candidates[0]


def _read_header(source: Source, stream: IO[bytes], what: str) -> _Header:
    try:
        major, minor = npy_format.read_magic(stream)
        read = {1: npy_format.read_array_header_1_0, 2: npy_format.read_array_header_2_0}.get(major)
        if read is None:
            raise source.fault(f"{what} is of NPY version {major}.{minor}, which cannot be read.")
        shape, fortran, dtype = read(stream)
    except InputError:
        raise
    except Exception as error:
        # The header is a Python literal that NumPy hands to its parser: hostile bytes reach exceptions of every kind in it.
        raise source.fault(f"{what} has a damaged NPY header: {str(error).splitlines()[0] if str(error) else error!r}.") from error
    if dtype.hasobject:
        raise source.fault(f"{what} holds Python objects; files from strangers are never unpickled.")
    if any(extent < 0 for extent in shape):
        raise source.fault(f"{what} declares the negative shape {shape}.")
    return _Header(tuple(map(int, shape)), bool(fortran), dtype, stream.tell())


def _read_array(source: Source, stream: IO[bytes], size: int, what: str) -> NDArray:
    header = _read_header(source, stream, what)
    count = 1
    for extent in header.shape:
        count *= extent
    if count * header.dtype.itemsize > size - header.size:
        held = (size - header.size) // max(1, header.dtype.itemsize)
        raise source.fault(f"{what} declares the shape {header.shape}, the payload ends after {held:,} of its numbers.", size)
    payload = stream.read(count * header.dtype.itemsize)
    if len(payload) < count * header.dtype.itemsize:
        raise source.fault(f"{what} is truncated.", size)
    flat = np.frombuffer(payload, header.dtype, count) if header.dtype.itemsize else np.zeros(0)
    if flat.size != count:
        raise source.fault(f"{what} declares values of no size.")
    return flat.reshape(header.shape, order="F" if header.fortran else "C")


def _as_points(source: Source, array: NDArray, what: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    names = array.dtype.names
    if names is not None:
        lower = [name.lower() for name in names]
        fields = [names[lower.index(axis)] for axis in "xyz" if axis in lower]
        if len(fields) < 3 or any(array[field].dtype.kind not in "fiu" or array[field].ndim != array.ndim for field in fields):
            raise source.fault(f"{what} has the fields {', '.join(names[:12])}, not x, y and z.")
        return np.stack([array[field].astype(np.float64).ravel() for field in fields], axis=1), ()
    notes = ()
    if array.dtype.kind in "fiu" and array.ndim == 3 and array.shape[2] == 3:
        notes = (f"{what} has the shape {array.shape}; it was read row after row.",)  # an organised cloud, or several clouds
        array = array.reshape(-1, 3)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise source.fault(f"{what} must be of numbers in (N, 3). Its shape is {array.shape}, its type {array.dtype}.")
    if array.shape[0] == 3 and array.shape[1] > 16:
        raise source.fault(f"{what} has the shape {array.shape}; points are rows: transpose it.")
    if array.shape[1] > 3:
        notes = (f"{what} has {array.shape[1]} columns; the first three were taken for x, y and z.",)
    return np.ascontiguousarray(array[:, :3], np.float64), notes
