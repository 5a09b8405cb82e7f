"""What the cloud tells of itself: how far apart its points are, and how noisy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import gammaincinv

from scan2nurbs.errors import NoResultError
from scan2nurbs.kernels.cells import POINTS_PER_CELL, Cells, build_cells
from scan2nurbs.kernels.nearest import nearest_distance, nearest_kth, nearest_to
from scan2nurbs.kernels.runner import Progress

NEIGHBOUR = 12
# Nearest points that a quadric is fitted to, and up to which noise, in h, their answer is believed.
NEIGHBOURHOODS = ((16, 0.85), (40, 1.15), (100, np.inf))
# Of strong noise the nearest points show less than there is: those that it moved away are not among them. What the residuals say,
# in h, of a plane with so much noise; measured, and the same whether its points lie on a grid or at random. Of less than 0.3 h
# they hide one or two per cent, which edges and curved faces make up for.
PLANE_NOISE = np.array([0.0, 0.3, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4])
PLANE_SHOWS = {
    16: np.array([0.0, 0.300, 0.386, 0.547, 0.643, 0.700, 0.725, 0.744]),
    40: np.array([0.0, 0.300, 0.394, 0.578, 0.730, 0.852, 0.929, 0.984]),
    100: np.array([0.0, 0.300, 0.396, 0.590, 0.769, 0.941, 1.076, 1.176]),
}
_SAMPLE = 4000
_H_SAMPLE = 20_000
_GUESS_SAMPLE = 4000


@dataclass(frozen=True)
class Scale:
    """Spacing and noise of a cloud, with the cell index they were measured in.

    Attributes
    ----------
    spacing : float
        d̄, the mean distance to the nearest other point (paper, eq. 2.1): the unit of the paper's radii.
    h : float
        The noise-stable spacing, median(d12)·sqrt(π/12) with d12 the distance to the 12th neighbour: on a surface of area A
        sampled by N points about sqrt(A/N). The unit of everything else. Large clouds are asked at every so many points.
    noise : float
        Standard deviation of the points across the surface, in the cloud's unit.
    cells : Cells
        The cell index, reused by the later stages.
    """

    spacing: float
    h: float
    noise: float
    cells: Cells

    @cached_property
    def local_h(self) -> NDArray[np.float64]:
        """Stable spacing at every point (N,), in the cloud's order; measured when it is first asked for."""
        cells = self.cells
        k = min(NEIGHBOUR, len(cells.points) - 1)
        distance = np.empty(len(cells.points))
        distance[cells.order] = nearest_kth(cells, k, reach=1.2 * self.h * math.sqrt(k / 2))
        return distance * math.sqrt(math.pi / k)


def measure_scale(points: NDArray[np.float64], *, progress: Progress | None = None) -> Scale:
    """Measure spacing and noise.

    Parameters
    ----------
    points : (N, 3) float64
        Distinct finite points, N >= 3.
    progress : callable, optional
        Called with (cells done, cells).

    Notes
    -----
    O(N) time; deterministic.
    """
    guess = _guess_spacing(points)
    cells = build_cells(points, math.sqrt(POINTS_PER_CELL) * guess)
    nearest = nearest_distance(cells, reach=1.5 * guess, progress=progress)
    h = _stable_spacing(cells)
    return Scale(spacing=float(nearest.mean()), h=h, noise=estimate_noise(cells, h), cells=cells)


def _stable_spacing(cells: Cells) -> float:
    k = min(NEIGHBOUR, len(cells.points) - 1)
    # Sorted points lie side by side: every so many of them are a sample that is spread evenly over the cloud.
    sample = cells.points[:: -(-len(cells.points) // _H_SAMPLE)]
    return float(np.median(nearest_to(cells, sample, k + 1)[1][:, k])) * math.sqrt(math.pi / k)


def _guess_spacing(points: NDArray[np.float64]) -> float:
    """Guess h from a part of the points, as if they lay evenly on a surface; only the size of the cells depends on it."""
    n = len(points)
    part = points if n <= _GUESS_SAMPLE else points[np.unique(np.random.default_rng(0).integers(0, n, _GUESS_SAMPLE))]
    k = min(4, len(part) - 1)
    distance = KDTree(part).query(part, k + 1)[0][:, k]
    return float(np.median(distance)) * math.sqrt(math.pi / k) * math.sqrt(len(part) / n)


def estimate_noise(cells: Cells, h: float) -> float:
    """Estimate the noise's standard deviation from residuals of local quadrics.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    h : float
        The noise-stable spacing.

    Returns
    -------
    float
        In the points' unit; 0 where there are too few points to tell.

    Notes
    -----
    A quadric is fitted to the nearest points of each of a few thousand points. Where an edge or a feature finer than that
    lies among them the residual is no noise, so it is not the median residual that counts but a low quantile, divided by
    what that quantile of a chi-square variable with as many degrees of freedom would be. Parts whose features are a few spacings
    wide have few smooth places even so: the nearest 16 points are asked first. Strong noise thickens these into a ball, which shows
    only part of it; the rest is added as on a noisy plane. Where the ball is so thick that little can be told, the neighbourhood grows;
    and the least answer counts, since on fine features a larger one has larger residuals, which are no noise.
    """
    answers = []
    for k, believed in NEIGHBOURHOODS:
        if len(cells.points) < k:
            break
        answers.append(_unhidden(_quadric_noise(cells, k) / h, k) * h)
        if answers[-1] < believed * h:
            break
    return min(answers, default=0.0)


def _unhidden(shown: float, k: int) -> float:
    """Return the noise, in h, of a plane that shows so much among the k nearest points."""
    shows = PLANE_SHOWS[k]
    return float(np.interp(shown, shows, PLANE_NOISE)) if shown < shows[-1] else shown * float(PLANE_NOISE[-1] / shows[-1])


def _quadric_noise(cells: Cells, k: int, quantile: float = 0.2) -> float:
    n = len(cells.points)
    chosen = np.linspace(0, n - 1, min(n, _SAMPLE)).astype(np.int64)
    index, distance = nearest_to(cells, cells.points[chosen], k)
    local = cells.points[index] - cells.points[chosen][:, None]
    local /= distance[:, -1][:, None, None]
    local -= local.mean(axis=1, keepdims=True)
    _, frame = np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))
    w, v, u = np.moveaxis(np.einsum("nki,nij->nkj", local, frame), 2, 0)
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)
    q, _ = np.linalg.qr(basis)
    residual = w - np.einsum("nkj,nj->nk", q, np.einsum("nkj,nk->nj", q, w))
    freedom = k - basis.shape[2]
    variance = (residual**2).sum(axis=1) * distance[:, -1] ** 2 / freedom
    return float(np.sqrt(np.quantile(variance, quantile) * freedom / chi2_quantile(quantile, freedom)))


def require_surface(scale: Scale) -> None:
    """Refuse points that lie on curves: what spacing and normals are measured from them means nothing.

    Raises
    ------
    NoResultError
        If most neighbourhoods form a line.
    """
    share = line_share(scale.cells)
    if share > 0.5:
        raise NoResultError(
            f"The neighbours of {share:.0%} of the points form a line: these points lie on curves, as the vertices of a CAD mesh do, "
            "and not all over a surface. Scan or sample the surface between them (`scan2nurbs simulate` does so from a STEP file)."
        )


def line_share(cells: Cells) -> float:
    """Return the share of points whose nearest neighbours form a line, in [0, 1]: near 0 on surfaces, near 1 on curves.

    Parameters
    ----------
    cells : Cells
        The sorted points.

    Notes
    -----
    A line is ten times as long as it is wide. The neighbours of a point on a scanned surface spread evenly about it, however noisy
    they are; the vertices of a CAD mesh lie along the edges of the part.
    """
    n = len(cells.points)
    chosen = cells.points[np.linspace(0, n - 1, min(n, _SAMPLE)).astype(np.int64)]
    index, _ = nearest_to(cells, chosen, min(NEIGHBOUR + 1, n))
    local = cells.points[index] - cells.points[index].mean(axis=1, keepdims=True)
    width = np.linalg.svd(local, compute_uv=False)
    return float(np.mean(width[:, 1] < 0.1 * width[:, 0]))


def chi2_quantile(probability: float, freedom: int) -> float:
    """Return the value that a χ² variable stays below with some probability; importing scipy.stats for it would take half a second."""
    return float(2.0 * gammaincinv(freedom / 2, probability))
