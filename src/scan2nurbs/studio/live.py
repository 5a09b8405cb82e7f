"""Sliders that need no new pass over the cloud: another threshold δ, another weight α of EDN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scan2nurbs.edges.detect import Edges
from scan2nurbs.edges.operators import edn
from scan2nurbs.edges.params import EdgeParams


def without_sliders(params: EdgeParams) -> EdgeParams:
    """Return the parameters without those that sliders move: equal ones need the same pass over the cloud."""
    return replace(params, threshold=None, alpha=0.4, beta=None)


def normals_of(params: EdgeParams) -> EdgeParams:
    """Return the parameters that the normals follow from: with operators that run one after the other, the sliders too."""
    return without_sliders(params) if len(params.runs()) == 1 else params


def moved(edges: Edges, before: EdgeParams, after: EdgeParams) -> Edges | None:
    """Return what `detect` would find with parameters that differ in threshold and α only.

    Parameters
    ----------
    edges : Edges
        What it found with the parameters `before`.
    before, after : EdgeParams

    Returns
    -------
    Edges or None
        None where a new pass is needed: where operators run one after the other, each on what the previous one kept, and where the
        threshold is to be chosen again.
    """
    if without_sliders(before) != without_sliders(after) or len(after.runs()) != 1:
        return None
    if after.threshold is None and before.threshold is not None:
        return None
    threshold = edges.threshold if after.threshold is None else after.threshold
    strength = edges.strength
    if after.runs() == ("edn",) and after.alpha != before.alpha:
        if edges.dn is None or edges.vdn_small is None or edges.vdn_large is None:
            return None
        strength = edn(edges.dn, edges.vdn_small, edges.vdn_large, after.alpha)
    mask = strength > threshold
    return replace(edges, strength=strength, mask=mask, threshold=threshold, runs=((edges.runs[0][0], int(np.count_nonzero(mask))),))
