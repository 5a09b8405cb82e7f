"""Find the primitives of a part and the points that belong to each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import (
    CANDIDATES,
    Sheet,
    adopt,
    criteria,
    drop_outliers,
    fit_regions,
    label_points,
    offered,
    plainest_models,
    select,
    split_pieces,
)
from scan2nurbs.faces.fillets import find_fillets
from scan2nurbs.faces.lost import find_lost
from scan2nurbs.faces.profiles import split_profiles
from scan2nurbs.faces.unite import unite
from scan2nurbs.faces.walls import straighten
from scan2nurbs.kernels.bends import unevenness
from scan2nurbs.kernels.labelling import candidate_costs
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, PLANE, TORUS
from scan2nurbs.kernels.proposals import propose
from scan2nurbs.kernels.runner import Progress

MOST_MODELS = 6000
ROUNDS = 5
LEAST_SEED = 15
RINGS = 2
FILLET_ROUNDS = (1, 2)
LOST_ROUNDS = (2, 3)
PROFILE_ROUND = 2


def find_primitives(
    sheet: Sheet,
    one_sided: NDArray[np.float64],
    curvature: NDArray[np.float64],
    kinds: NDArray[np.bool_],
    least: int,
    progress: Progress | None,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Grow primitives, then let them compete, be fitted anew, split and joined.

    Parameters
    ----------
    sheet : Sheet
    one_sided : (N, 3) float64
        Normals that do not blur across creases: where neighbourhoods end.
    curvature : (N, 2) float64
        Principal curvatures.
    kinds : (6,) bool
        Kinds that may be found.
    least : int
        Fewest points a face.
    progress : callable, optional

    Returns
    -------
    label : (N,) int32
    models : (M, SIZE) float64
    """
    seeds = np.argsort(unevenness(curvature, sheet.neighbours), kind="stable").astype(np.int32)
    models, label, candidates = propose(
        sheet.points,
        one_sided,
        sheet.neighbours,
        seeds,
        kinds,
        sheet.sigma,
        sheet.tilt,
        least=LEAST_SEED,
        most=MOST_MODELS,
        room=CANDIDATES,
    )
    refits = kinds.copy()
    refits[PATCH] = False
    for step in range(ROUNDS):
        costs = candidate_costs(sheet.points, sheet.normals, models, candidates, sheet.sigma, sheet.tilt)
        candidates = select(candidates, costs, models)
        label, models = split_pieces(sheet, label_points(sheet, models, candidates), models, least)
        values = fit_regions(sheet, label, models, refits)
        label, models = unite(sheet, label, models, values, refits)
        if step == ROUNDS - 1:
            break
        if step == PROFILE_ROUND:  # a wall that took in the floor's edge gives it back
            label, models = split_profiles(sheet, label, models, refits)
        if step in FILLET_ROUNDS and kinds[CYLINDER] and kinds[TORUS]:
            sheet, label, models = _fillets(sheet, label, models, refits)
        if step in LOST_ROUNDS and kinds[PLANE]:
            label, models = find_lost(sheet, label, models, least)
        candidates = offered(sheet, label, models, RINGS)
        if progress is not None:
            progress(step + 1, ROUNDS)
    # Of narrow strips the energy cannot pay for two borders; profiles and lines of contact tell where they end.
    label, models = split_profiles(sheet, label, models, refits)
    if kinds[CYLINDER] and kinds[TORUS]:
        _, label, models = _fillets(sheet, label, models, refits)
    label, models = straighten(sheet, label, models, refits)
    label, models = split_pieces(sheet, label, models, least, strips=True)
    label, models = unite(sheet, label, models, criteria(sheet, label, models), refits)  # strips that their neighbours explain as well
    return drop_outliers(sheet, adopt(sheet, label, models, RINGS), models), models


def _fillets(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], kinds: NDArray[np.bool_]
) -> tuple[Sheet, NDArray[np.int32], NDArray[np.float64]]:
    """Look for fillets beside the plainest models; the regions that have none keep the models that they had."""
    plain = plainest_models(sheet, label, models, kinds)
    sheet, found, wider = find_fillets(sheet, label, plain)
    beside = np.unique(label[(found != label) & (label >= 0)])
    kept = models.copy()
    kept[beside] = plain[beside]
    return sheet, found, np.vstack([kept, wider[len(models) :]])
