"""What every record says of a scan: where it came from, its size, its spacing and noise."""

from __future__ import annotations

from typing import Any, Protocol

from scan2nurbs.cloud import PointCloud

NOISY = 0.7
"""Noise, in units of h, above which no operator finds edges dependably."""


class Scaled(Protocol):
    """What knows the spacing and the noise of a cloud."""

    @property
    def spacing(self) -> float:
        """d̄, eq. 2.1."""
        ...

    @property
    def h(self) -> float:
        """The noise-stable spacing."""
        ...

    @property
    def noise(self) -> float:
        """Standard deviation."""
        ...


def input_record(cloud: PointCloud) -> dict[str, Any]:
    """Say what was read."""
    low, high = cloud.points.min(axis=0) + cloud.origin, cloud.points.max(axis=0) + cloud.origin
    return {
        "path": cloud.source,
        "format": cloud.format,
        "sha256": cloud.sha256,
        "n_rows": len(cloud.rows),
        "n_points": len(cloud.points),
        "n_invalid": cloud.n_invalid,
        "n_duplicates": cloud.n_duplicates,
        "unit": cloud.unit,
        "low": low,
        "high": high,
    }


def scale_record(scale: Scaled) -> dict[str, float]:
    """Say how far apart the points are, and how noisy."""
    return {"spacing": scale.spacing, "h": scale.h, "noise": scale.noise}


def scale_warnings(scale: Scaled) -> list[str]:
    """Say what the scale forbids to expect."""
    if scale.noise <= NOISY * scale.h:
        return []
    ratio = scale.noise / scale.h
    return [f"The noise is {ratio:.2g} times the distance between points: edges and details of a few points' width cannot be told from it."]
