"""What every report says besides its results: versions, seconds, memory; and how it becomes JSON."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

LIBRARIES = ("scan2nurbs", "numpy", "scipy", "numba", "cadquery-ocp-novtk")


def plain(value: Any) -> Any:
    """Turn results into what JSON can hold.

    Dataclasses become objects, arrays lists, paths and enums strings; NaN and infinite numbers, which JSON has not, become None.
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return _plain_container(value)


def _plain_container(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Sequence):
        return [plain(item) for item in value]
    if isinstance(value, set | frozenset):
        return sorted(plain(item) for item in value)
    if isinstance(value, os.PathLike):
        return str(Path(value))
    raise TypeError(f"a {type(value).__name__} cannot stand in a report")


def to_json(record: Mapping[str, Any]) -> str:
    """Write a report as one JSON object, ending in a line feed."""
    return json.dumps(plain(record), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def versions() -> dict[str, str]:
    """Return the versions of scan2nurbs, its libraries, Python and the system."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found | {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}


def peak_memory_mb() -> float | None:
    """Return the most memory (megabytes, 10^6 bytes) this process has held so far, or None where the system does not tell."""
    try:
        # ru_maxrss would count the parent's memory too where this process was forked from a large one.
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        return round(int(status.split("VmHWM:")[1].split()[0]) * 1024 / 1e6, 1)
    except (OSError, IndexError, ValueError):
        pass
    try:
        import resource  # noqa: PLC0415 - not there on Windows
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6, 1)


class Stopwatch:
    """Seconds a stage, in the order in which the stages ran.

    Attributes
    ----------
    seconds : dict of str to float
        What each stage took; a stage that ran twice holds the sum.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block as `stage`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = round(self.seconds.get(stage, 0.0) + time.perf_counter() - start, 4)
