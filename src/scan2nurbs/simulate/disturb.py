"""What a real scan adds to the truth, and what it leaves out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart
from scan2nurbs.simulate.params import SimulateParams
from scan2nurbs.simulate.samples import Samples
from scan2nurbs.simulate.sampling import sample_random


def without_holes(samples: Samples, part: CadPart, spacing: float, params: SimulateParams) -> Samples:
    """Leave out the samples in round patches at random places of the scanned surface."""
    if params.holes == 0 or len(samples) == 0:
        return samples
    places = samples.positions(part.corners)
    # Places that do not depend on the pitch, so that the holes stay where they are while it is adjusted.
    anywhere = sample_random(part, float(np.sqrt(part.area / (20 * params.holes + 200))), params).positions(part.corners)
    near, _ = KDTree(places).query(anywhere)
    centres = anywhere[near < 3 * spacing][: params.holes]
    if len(centres) == 0:
        return samples
    distance, _ = KDTree(centres).query(places, distance_upper_bound=params.hole_radius * spacing)
    return samples[np.isinf(distance)]


def add_noise(
    clean: NDArray[np.float64],
    normal: NDArray[np.float64],
    ray: NDArray[np.float64],
    along: float,
    across: float,
    params: SimulateParams,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return the places with Gaussian noise along and across their rays.

    Along the ray it grows with the incidence θ as cos θ to the power −`noise_growth`, up to where the grazing limit ends it.
    """
    least = np.cos(np.radians(params.grazing_limit)) if params.mode == "scanner" else 0.0
    cosine = np.clip(np.abs(np.einsum("nc,nc->n", normal, ray)), max(least, 1e-3), 1.0)
    sideways = rng.normal(size=clean.shape) * across
    sideways -= np.einsum("nc,nc->n", sideways, ray)[:, None] * ray
    return clean + sideways + (rng.normal(size=len(clean)) * along * cosine**-params.noise_growth)[:, None] * ray


def add_outliers(clean: NDArray[np.float64], count: int, spacing: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return points that belong to nothing: half of them in the box 5 percent around the part, half 3 to 15 spacings beside a point."""
    low, size = clean.min(axis=0), np.ptp(clean, axis=0)
    margin = 0.05 * size.max()
    far = low - margin + rng.random((count // 2, 3)) * (size + 2 * margin)
    n_near = count - len(far)
    aside = rng.normal(size=(n_near, 3))
    aside *= (rng.uniform(3, 15, n_near) * spacing / np.linalg.norm(aside, axis=1))[:, None]
    return np.concatenate([far, clean[rng.integers(len(clean), size=n_near)] + aside])
