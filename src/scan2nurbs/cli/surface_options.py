"""The stages of `surface`: which parameters have an option, and how one `SurfaceParams` is made of what was given."""

from __future__ import annotations

from typing import Any

from scan2nurbs.cli.config import Config, parameters
from scan2nurbs.cli.edges import EDGES
from scan2nurbs.cli.options import Given, Stage, place
from scan2nurbs.edges.boundary import BoundaryParams
from scan2nurbs.edges.clean import CleanParams
from scan2nurbs.edges.corrections import read_selection
from scan2nurbs.edges.curves import CurveParams
from scan2nurbs.edges.thin import ThinParams
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.region import RegionParams
from scan2nurbs.pipeline import SurfaceParams
from scan2nurbs.surfaces.fit import FitParams


def parse_degree(text: str) -> int | tuple[int, ...]:
    """Read one degree, or those in u and v, such as "3,2"."""
    try:
        degrees = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"The 'degree' must be a whole number, or two such as '3,2'. Got {text!r} instead.") from None
    return degrees[0] if len(degrees) == 1 else degrees


_DENSITY = {name: f"density-{name.replace('_', '-')}" for name in ("neighbours", "deviations", "radius", "min_points")}

CLEAN = Stage(
    section="clean",
    params=CleanParams,
    panel="Cleaning the boundary",
    options={"method": "density-filter", **_DENSITY},
    shown=frozenset({"method", *_DENSITY}),
)
BOUNDARY = Stage(
    section="boundary",
    params=BoundaryParams,
    panel="Cleaning the boundary",
    shown=frozenset({"thinning", "thin_radius", "thin_times", "keep_only", "drop"}),
    nested=frozenset({"clean", "thin", "curves"}),
    parse={"keep_only": read_selection, "drop": read_selection},
    metavars={"keep_only": "FILE", "drop": "FILE"},
)
THIN = Stage(section="thin", params=ThinParams, panel="Cleaning the boundary", shown=frozenset(), nested=frozenset({"clean"}))
CURVES = Stage(section="curves", params=CurveParams, panel="Cleaning the boundary", shown=frozenset())
SURFACE = Stage(
    section="surface",
    params=SurfaceParams,
    panel="Choosing the surface",
    nested=frozenset({"edges", "boundary", "region", "fit"}),
)
REGION = Stage(
    section="region",
    params=RegionParams,
    panel="Choosing the surface",
    shown=frozenset({"seed"}),
    parse={"seed": place},
    metavars={"seed": "X,Y,Z"},
)
FIT = Stage(
    section="fit",
    params=FitParams,
    panel="Fitting",
    shown=frozenset({"degree", "tolerance", "noise", "smoothness", "max_control_points", "robust"}),
    parse={"degree": parse_degree},
    metavars={"degree": "N or N,N"},
)
STAGES = (EDGES, CLEAN, BOUNDARY, THIN, CURVES, SURFACE, REGION, FIT)


def effective(params: SurfaceParams) -> dict[str, dict[str, Any]]:
    """Return all parameters by section, as a config file would hold them."""
    boundary = params.boundary
    used = (params.edges, boundary.clean, boundary, boundary.thin, boundary.curves, params, params.region, params.fit)
    return {stage.section: {key: getattr(value, key) for key in stage.names()} for stage, value in zip(STAGES, used, strict=True)}


def surface_params(given: Given, config: Config) -> SurfaceParams:
    """Make the parameters of a run."""

    def made(stage: Stage, **nested: object) -> object:
        return parameters(stage, given, config, given.common.config, **nested)

    boundary = made(BOUNDARY, clean=made(CLEAN), thin=made(THIN), curves=made(CURVES))
    return parameters(SURFACE, given, config, given.common.config, edges=made(EDGES), boundary=boundary, region=made(REGION), fit=made(FIT))
