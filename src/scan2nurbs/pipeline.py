"""The paper's case on one page: from a scan to the trimmed B-spline face of one functional surface."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.face import TrimmedFace, trimmed_face
from scan2nurbs.brep.outline import Loop
from scan2nurbs.brep.write import WrittenModel, write_model
from scan2nurbs.cloud import PointCloud, PointSource, as_cloud
from scan2nurbs.edges.boundary import Boundary, BoundaryParams, EdgeBand, clean_edges, draw_boundary
from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.inside import enclosed_by_centroid
from scan2nurbs.faces.region import Region, RegionParams, group_points
from scan2nurbs.faces.trim import REACH, Trim, trim_region
from scan2nurbs.kernels.runner import Progress, thread_count
from scan2nurbs.ranges import require_instance
from scan2nurbs.report.record import Stopwatch
from scan2nurbs.scale import Scale, measure_scale, require_surface
from scan2nurbs.surface_report import surface_report
from scan2nurbs.surfaces.fit import FitParams, SurfaceFit, fit_surface

StageProgress = Callable[[str, int, int], None]
"""Called with the stage's name, how much of it is done, and how much there is."""

PARTED = "The surface between the edges could not be unrolled as a whole; the part of it between its bends was taken."


@dataclass(frozen=True, kw_only=True)
class SurfaceParams:
    """Parameters of `reconstruct_surface`: one dataclass a stage.

    Attributes
    ----------
    edges : EdgeParams
        The operator that finds boundary points.
    boundary : BoundaryParams
        Filters, thinning and curves of the boundary, and corrections by hand.
    grouping : {"basins", "algorithm-3"}
        How inside and outside are told apart: the default is right for outlines of any form; Algorithm 3 of the paper needs one
        that is star-shaped about its centroid.
    region : RegionParams
        Which surface is wanted (for "basins").
    fit : FitParams
        Degrees, tolerance and fairness of the B-spline surface.
    """

    edges: EdgeParams = field(default_factory=EdgeParams)
    boundary: BoundaryParams = field(default_factory=BoundaryParams)
    grouping: Literal["basins", "algorithm-3"] = "basins"
    region: RegionParams = field(default_factory=RegionParams)
    fit: FitParams = field(default_factory=FitParams)

    def __post_init__(self) -> None:
        """Check what the stages' own dataclasses do not."""
        for name, kind in (("edges", EdgeParams), ("boundary", BoundaryParams), ("region", RegionParams), ("fit", FitParams)):
            require_instance(getattr(self, name), name, "reconstruct_surface", kind)
        if self.grouping not in ("basins", "algorithm-3"):
            raise ParameterError(f"The 'grouping' of reconstruct_surface must be 'basins' or 'algorithm-3'. Got {self.grouping!r} instead.")


@dataclass(frozen=True)
class SurfaceModel:
    """One functional surface of a scan, from its points to its trimmed face.

    Points and lengths are in the cloud's local frame and unit; `write` moves the face back to the input's coordinates.

    Attributes
    ----------
    cloud : PointCloud
        The points, their unit and origin.
    scale : Scale
        Spacing and noise.
    edges : Edges
        Points on edges, in the cloud's order.
    band : EdgeBand
        What is left of them after corrections and filters.
    boundary : Boundary
        The boundary of the surface, thinned and as curves.
    region : Region or None
        The surfaces between the edges; None where Algorithm 3 grouped the points.
    fitted : (K,) int64
        The points that were fitted.
    fit : SurfaceFit
        The surface, fitted to ``cloud.points[fitted]``.
    inside : (N,) bool
        Points of the face.
    trim : Trim
        The face's outline in the parameters of the surface.
    face : TrimmedFace
        The face.
    report : dict
        All figures, as they stand in the JSON.
    """

    cloud: PointCloud
    scale: Scale
    edges: Edges
    band: EdgeBand
    boundary: Boundary
    region: Region | None
    fitted: NDArray[np.int64]
    fit: SurfaceFit
    inside: NDArray[np.bool_]
    trim: Trim
    face: TrimmedFace
    report: dict[str, Any]

    def write(self, path: str | os.PathLike[str], *, schema: str = "AP242") -> WrittenModel:
        """Write the face to a STEP, IGES, BREP, 3DM or mesh file, by its suffix, in the input's unit and coordinates.

        Raises
        ------
        OutputError
            If the file cannot be written, or does not read back as it was written; nothing is left then.
        """
        name = Path(self.cloud.source).stem
        return write_model(path, self.face, unit=self.cloud.unit, origin=self.cloud.origin, name=name, schema=schema)


def reconstruct_surface(
    source: PointSource, params: SurfaceParams | None = None, *, unit: str | None = None, progress: StageProgress | None = None
) -> SurfaceModel:
    """Reconstruct one functional surface: edges, boundary, inside, B-spline surface, trimmed face.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    params : SurfaceParams, optional
        By default everything is chosen from the cloud.
    unit : str, optional
        Overrides what the file says.
    progress : callable, optional
        Called with (stage, done, total) as the stages go on.

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    NoResultError
        If no surface lies between the edges, or no B-spline surface fits its points.

    Notes
    -----
    The paper's procedure (section 2), automatic: the result depends on the points and the parameters alone.
    """
    params = params or SurfaceParams()
    require_instance(params, "params", "reconstruct_surface", SurfaceParams)
    params = replace(params, edges=params.edges.resolved("one-sided"))
    watch = Stopwatch()

    def stage(name: str) -> Progress | None:
        call = progress
        return None if call is None else lambda done, total: call(name, done, total)

    with watch("read"):
        cloud = as_cloud(source, unit)
    with watch("scale"):
        scale = measure_scale(cloud.points, progress=stage("measuring"))
        require_surface(scale)
    with watch("edges"):
        edges = detect(cloud.points, scale, params.edges, stage("finding edges"))
    with watch("boundary"):
        band = clean_edges(cloud, scale, edges, params.boundary)
    inside, fit = _fit(cloud, scale, edges, band, params, watch, stage("fitting"))
    with watch("trim"):
        trim = trim_region(cloud.points, scale, inside.fitted, fit, inside.boundary.points)
        loops = [Loop(loop.uv, loop.closed) for loop in trim.loops]
        face = trimmed_face(trim.surface, loops, tolerance=max(0.5 * scale.h, 2.0 * scale.noise))
    model = SurfaceModel(cloud, scale, edges, band, *inside, fit, trim.inside, trim, face, {})
    return replace(model, report=surface_report(model, params, watch.seconds))


class _Inside(NamedTuple):
    """What is to be fitted: the boundary, the surfaces between the edges, and the points of the chosen one."""

    boundary: Boundary
    region: Region | None
    fitted: NDArray[np.int64]


def _fit(
    cloud: PointCloud, scale: Scale, edges: Edges, band: EdgeBand, params: SurfaceParams, watch: Stopwatch, progress: Progress | None
) -> tuple[_Inside, SurfaceFit]:
    """Fit a surface to what the edges enclose; where no map without folds is found for it, to what the bends enclose as well."""
    wanted = _in_local_frame(params.region, cloud)
    fit_params = _with_noise(params.fit, scale)
    inside = _group(cloud, scale, edges, band, params, wanted, watch)
    try:
        with watch("fit"):
            return inside, fit_surface(cloud.points[inside.fitted], fit_params, progress=progress)
    except NoResultError:
        if inside.region is None or wanted.bends_part:
            raise
        finer = _group(cloud, scale, edges, band, params, replace(wanted, bends_part=True), watch)
        if len(finer.fitted) >= len(inside.fitted):
            raise
    with watch("fit"):
        fit = fit_surface(cloud.points[finer.fitted], fit_params, progress=progress)
    return finer, replace(fit, notes=(*fit.notes, PARTED))


def _group(
    cloud: PointCloud, scale: Scale, edges: Edges, band: EdgeBand, params: SurfaceParams, wanted: RegionParams, watch: Stopwatch
) -> _Inside:
    """Tell inside from outside, and draw the boundary."""
    if params.grouping == "basins":
        with watch("inside"):
            region = group_points(cloud.points, scale, edges, band.on_edge, wanted)
            fitted = np.flatnonzero(region.inside | region.rim)
        with watch("boundary"):
            boundary = draw_boundary(cloud, scale, _beside(band.on_edge, cloud, fitted, scale), params.boundary)
        return _Inside(boundary, region, fitted)
    with watch("boundary"):
        boundary = draw_boundary(cloud, scale, band.on_edge, params.boundary)
    with watch("inside"):
        return _Inside(boundary, None, _enclosed(cloud, band, boundary))


def _in_local_frame(region: RegionParams, cloud: PointCloud) -> RegionParams:
    """Move the seed from the input's coordinates to the cloud's."""
    if region.seed is None:
        return region
    x, y, z = np.asarray(region.seed) - cloud.origin
    return replace(region, seed=(float(x), float(y), float(z)))


def _beside(on_edge: NDArray[np.bool_], cloud: PointCloud, fitted: NDArray[np.int64], scale: Scale) -> NDArray[np.bool_]:
    """Choose the edge points along the surface: its boundary, not that of others."""
    band = np.flatnonzero(on_edge)
    distance, _ = KDTree(cloud.points[fitted]).query(cloud.points[band], distance_upper_bound=REACH * scale.h, workers=thread_count())
    beside = np.zeros_like(on_edge)
    beside[band[np.isfinite(distance)]] = True
    return beside


def _enclosed(cloud: PointCloud, band: EdgeBand, boundary: Boundary) -> NDArray[np.int64]:
    """Group by Algorithm 3: the points that the thinned boundary encloses."""
    if len(boundary.points) == 0:
        raise NoResultError("Algorithm 3 needs boundary points, and none are left; a smaller threshold finds more.")
    inside = np.flatnonzero(enclosed_by_centroid(cloud.points, boundary.points) & ~band.on_edge)
    if len(inside) == 0:
        raise NoResultError("By Algorithm 3 no point lies inside the boundary: its outline is not star-shaped about its centroid.")
    return inside


def _with_noise(fit: FitParams, scale: Scale) -> FitParams:
    """Tell the fit how noisy the points are, unless the caller knows better."""
    return fit if fit.noise is not None else replace(fit, noise=scale.noise)
