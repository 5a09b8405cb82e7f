"""One measurement in a process of its own: ``python -m benchmarks.peers JOB POINTS.npy RADIUS NEIGHBOURS REPEATS OUT.npz``.

A job is a library's normals at a radius, SciPy's spacing, or a piece of scan2nurbs; it imports what it needs itself. The radius is
in the points' unit; NEIGHBOURS is the mean number in a ball, for the library that knows no radius.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

THREADS = 2


def open3d(points, radius, neighbours):
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(radius))
    return np.asarray(cloud.normals)


def jakteristics(points, radius, neighbours):
    import jakteristics

    return jakteristics.compute_features(points, search_radius=radius, num_threads=THREADS, feature_names=["nx", "ny", "nz"])


def pgeof(points, radius, neighbours):
    import pgeof

    features = pgeof.EFeatureID
    wanted = [features.Normal_x, features.Normal_y, features.Normal_z]
    return pgeof.compute_features_selected(np.ascontiguousarray(points, np.float32), radius, len(points), wanted)


def point_cloud_utils(points, radius, neighbours):
    import point_cloud_utils as pcu

    # What it calls the radius is compared with squares of distances.
    index, normals = pcu.estimate_point_cloud_normals_ball(points, radius**2, num_threads=THREADS)
    out = np.full(points.shape, np.nan)
    out[index] = normals
    return out


def small_gicp(points, radius, neighbours):
    import small_gicp

    cloud = small_gicp.PointCloud(points)
    small_gicp.estimate_normals(cloud, num_neighbors=max(round(neighbours), 3), num_threads=THREADS)
    return np.asarray(cloud.normals())[:, :3]


def scipy_spacing(points, radius, neighbours):
    from scipy.spatial import cKDTree

    return cKDTree(points).query(points, 2, workers=THREADS)[0][:, 1]


def our_normals(points, radius, neighbours):
    from scan2nurbs.edges.normals import normals_at

    cells = our_cells(points, radius, neighbours)
    out = np.empty_like(points)
    out[cells.order] = normals_at(cells, radius, only_normals=True).normal
    return out


def our_cells(points, radius, neighbours):
    from scan2nurbs.kernels.cells import POINTS_PER_CELL, build_cells
    from scan2nurbs.scale import _guess_spacing

    return build_cells(points, POINTS_PER_CELL**0.5 * _guess_spacing(points))


def our_edn(points, radius, neighbours):
    from scan2nurbs import EdgeParams, detect_edges

    return detect_edges(points, EdgeParams(operator="edn", large_radius=30)).strength


def our_wide_edn(points, radius, neighbours):
    from scan2nurbs import EdgeParams, detect_edges

    return detect_edges(points, EdgeParams(operator="edn", large_radius=120)).strength


PEERS = {
    "Open3D": open3d,
    "jakteristics": jakteristics,
    "pgeof": pgeof,
    "point-cloud-utils": point_cloud_utils,
    "small_gicp (k nearest)": small_gicp,
}
JOBS = PEERS | {
    "scipy spacing": scipy_spacing,
    "scan2nurbs normals": our_normals,
    "scan2nurbs cells": our_cells,
    "scan2nurbs EDN": our_edn,
    "scan2nurbs EDN, r_l = 120": our_wide_edn,
}


def memory(what: str) -> float:
    """Return the memory in use, or the most so far, in bytes, where Linux says it; else NaN."""
    status = Path("/proc/self/status")
    lines = status.read_text(encoding="ascii").splitlines() if status.exists() else []
    return 1024.0 * float(next((line.split()[1] for line in lines if line.startswith(what)), "nan"))


def main(job: str, source: str, radius: str, neighbours: str, repeats: str, out: str) -> None:
    points = np.load(source)
    JOBS[job](points[:3000].copy(), float(radius), 12.0)  # loads and compiles
    before = memory("VmRSS")
    seconds = np.inf
    for _ in range(int(repeats)):
        start = time.perf_counter()
        result = JOBS[job](points, float(radius), float(neighbours))
        seconds = min(seconds, time.perf_counter() - start)
    peak = memory("VmHWM") - before
    values = result if isinstance(result, np.ndarray) else np.empty(0)
    np.savez(out, result=values, seconds=seconds, bytes_a_point=max(peak, 0) / len(points))


if __name__ == "__main__":
    main(*sys.argv[1:])
