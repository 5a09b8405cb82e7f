"""The stages as plain functions on anything that holds points; results are per row of the input.

Each imports what it needs when it is called: who looks for edges does not wait for the fitting of surfaces to be loaded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scan2nurbs.cloud import PointCloud, PointSource, as_cloud
from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.kinds import with_kinds
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.scale import Scale, measure_scale

if TYPE_CHECKING:
    from scan2nurbs.faces.segmentation import Faces
    from scan2nurbs.part import PartParams, StageProgress
    from scan2nurbs.surfaces.fit import FitParams, SurfaceFit


@dataclass(frozen=True)
class Measured:
    """A cloud and what it tells of itself.

    Attributes
    ----------
    cloud : PointCloud
        The points, their unit, and what was left out.
    scale : Scale
        Spacing and noise.
    """

    cloud: PointCloud
    scale: Scale


def measure(source: PointSource, unit: str | None = None, *, progress: Progress | None = None) -> Measured:
    """Measure the spacing and the noise of a cloud.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    unit : str, optional
        Overrides what the file says.
    progress : callable, optional
        Called with (cells done, cells).

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    """
    cloud = as_cloud(source, unit)
    return Measured(cloud=cloud, scale=measure_scale(cloud.points, progress=progress))


def detect_edges(source: PointSource, params: EdgeParams | None = None, *, progress: Progress | None = None) -> Edges:
    """Find the points on the edges of functional surfaces.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    params : EdgeParams, optional
        Operator, radii, weights and threshold; by default everything is chosen from the cloud.
    progress : callable, optional
        Called with (cells done, cells) by each pass over the cloud.

    Returns
    -------
    Edges
        One value a row of the input, in its order. A row that is no point has strength NaN and is on no edge.

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    """
    measured = measure(source, progress=progress)
    edges = with_kinds(measured.scale, detect(measured.cloud.points, measured.scale, params or EdgeParams(), progress))
    return edges_by_row(edges, measured.cloud)


def edges_by_row(edges: Edges, cloud: PointCloud) -> Edges:
    """Spread edges from the cloud's points over the rows of the input."""
    optional = {
        name: None if values is None else cloud.to_rows(values, np.nan)
        for name, values in (
            ("dn", edges.dn),
            ("vdn_small", edges.vdn_small),
            ("vdn_large", edges.vdn_large),
            ("angle", edges.angle),
            ("angle_error", edges.angle_error),
        )
    }
    for name, none in (("kind", edges.kind), ("confidence", edges.confidence)):
        optional[name] = None if none is None else cloud.to_rows(none, 0)
    return replace(
        edges,
        strength=cloud.to_rows(edges.strength, np.nan),
        mask=cloud.to_rows(edges.mask, False),
        normal=cloud.to_rows(edges.normal, np.nan),
        **optional,
    )


def fit_surface(source: PointSource, params: FitParams | None = None, *, progress: Progress | None = None) -> SurfaceFit:
    """Fit one B-spline surface to all points of a cloud.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        Points of one surface.
    params : FitParams, optional
        Degrees, tolerance, fairness.
    progress : callable, optional
        Called with (round, most rounds).

    Returns
    -------
    SurfaceFit
        In the input's coordinates; residuals, weights and parameters are one a row of the input, NaN (weight 0) where the row is
        no point.

    Raises
    ------
    InputError
        If the source cannot be read.
    NoResultError
        If the points do not determine a surface.
    """
    from scan2nurbs.surfaces.fit import fit_surface as fit_points  # noqa: PLC0415

    cloud = as_cloud(source)
    fit = fit_points(cloud.points, params, progress=progress)
    surface = replace(fit.surface, control_points=fit.surface.control_points + cloud.origin)
    return replace(
        fit,
        surface=surface,
        uv=cloud.to_rows(fit.uv, np.nan),
        residuals=cloud.to_rows(fit.residuals, np.nan),
        weights=cloud.to_rows(fit.weights, 0.0),
    )


def segment(source: PointSource, params: PartParams | None = None, *, progress: StageProgress | None = None) -> Faces:
    """Split a scan into faces.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    params : PartParams, optional
        By default everything is chosen from the cloud.
    progress : callable, optional
        Called with (stage, done, total) as the stages go on.

    Returns
    -------
    Faces
        One label a row of the input, in its order, −1 for none; the faces' shapes lie in the input's coordinates about
        ``PointCloud.origin``, which is zero for points that lie about zero.

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    NoResultError
        If the points lie on no surface, or no face is found among them.
    """
    from scan2nurbs.part import part_scan  # noqa: PLC0415

    parted = part_scan(source, params, progress=progress)
    return replace(parted.faces, label=parted.label)
