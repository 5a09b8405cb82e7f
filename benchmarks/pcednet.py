"""Our default beside the published methods on the ABC clouds of the PCEDNet supplement (Himeur et al. 2022, CC BY 3.0)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

import scan2nurbs as s2n

SHARP = 2
WITHIN = 1.5
"""Tolerance in mean distances to the nearest other point."""

PUBLISHED = {
    "pced": "PCEDNet (learned, oriented normals)",
    "pcpnetabc": "PCPNet (learned on ABC)",
    "ecnet": "EC-Net (learned)",
    "cnn": "CNN (learned)",
    "ca": "covariance analysis",
    "fee": "FEE",
}


def scores(points: NDArray[np.float64], truth: NDArray[np.bool_], marked: NDArray[np.bool_]) -> tuple[float, float]:
    """Return F1 point by point, and within `WITHIN` mean distances to the nearest other point."""
    both = np.count_nonzero(truth & marked)
    exact = 2 * both / max(np.count_nonzero(truth) + np.count_nonzero(marked), 1)
    if not truth.any() or not marked.any():
        return exact, 0.0
    reach = WITHIN * float(KDTree(points).query(points, 2)[0][:, 1].mean())
    precision = float((KDTree(points[truth]).query(points[marked])[0] <= reach).mean())
    recall = float((KDTree(points[marked]).query(points[truth])[0] <= reach).mean())
    return exact, 2 * precision * recall / max(precision + recall, 1e-12)


def report(folder: Path) -> str:
    """Score all clouds of a folder, and return a Markdown table."""
    found: dict[str, dict[str, list[tuple[float, float]]]] = {"clean": {}, "noisy": {}}
    n = 0
    for path in sorted(folder.glob("pcednet_abc_*.npz")):
        with np.load(path) as arrays:
            data = dict(arrays)
        truth, n = data["label"] == SHARP, n + 1
        for kind, key, prefix in (("clean", "points", "pred_"), ("noisy", "points_noise", "pred_noise_")):
            points = data[key].astype(np.float64)
            rows = found[kind]
            rows.setdefault("**scan2nurbs, default**", []).append(scores(points, truth, s2n.detect_edges(points).mask))
            for method, name in PUBLISHED.items():
                if prefix + method in data:
                    rows.setdefault(name, []).append(scores(points, truth, data[prefix + method] == SHARP))
    if n == 0:
        return f"No pcednet_abc_*.npz was found in {folder}."
    lines = ["| F1 exact / within 1.5 | clean | noisy |", "|---|---|---|"]
    for name in dict.fromkeys([*found["clean"], *found["noisy"]]):
        lines.append(f"| {name} | {_mean(found['clean'].get(name))} | {_mean(found['noisy'].get(name))} |")
    return (
        f"Mean F1 over {n} clouds, point by point / within 1.5 mean distances to the nearest other point. The published methods'\n"
        "marks are those of the supplement's files, scored in the same way; ours is the default: nothing set, no normals.\n\n"
        + "\n".join(lines)
    )


def _mean(values: list[tuple[float, float]] | None) -> str:
    return "–" if not values else " / ".join(f"{value:.2f}" for value in np.mean(values, axis=0))
