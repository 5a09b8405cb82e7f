"""The parts of the JSON that several commands have in common, and how they read as lines."""

from __future__ import annotations

from collections.abc import Sequence

from scan2nurbs.cloud import PointCloud
from scan2nurbs.scan_record import input_record, scale_record, scale_warnings

__all__ = ["aligned", "input_line", "input_record", "length", "scale_record", "scale_warnings"]


def input_line(cloud: PointCloud) -> str:
    """Return one line about the scan."""
    return f"{cloud.source}: {cloud.format}, {len(cloud.points):,} points in {cloud.unit}"


def aligned(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return name and value in two columns."""
    width = max((len(name) for name, _ in pairs), default=0)
    return [f"  {name:<{width}}  {value}" for name, value in pairs]


def length(value: float | None, unit: str) -> str:
    """Write a length with its unit, to three digits."""
    return "unknown" if value is None else f"{value:.3g} {unit}"
