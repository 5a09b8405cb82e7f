"""scan2nurbs: from a raw 3D scan to an editable CAD model.

Everything public is imported when it is first used, so that ``import scan2nurbs`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scan2nurbs.api import detect_edges, fit_surface, measure, segment
    from scan2nurbs.cloud import PointCloud, as_cloud
    from scan2nurbs.edges.boundary import BoundaryParams
    from scan2nurbs.edges.detect import Edges
    from scan2nurbs.edges.params import EdgeParams
    from scan2nurbs.errors import InputError, MissingExtraError, NoResultError, OutputError, ParameterError, Scan2NurbsError
    from scan2nurbs.faces.corrections import FaceCorrections, read_face_corrections
    from scan2nurbs.faces.region import RegionParams
    from scan2nurbs.faces.segmentation import Faces, SegmentParams
    from scan2nurbs.faces.topology import TopologyParams
    from scan2nurbs.kernels.runner import set_threads
    from scan2nurbs.part import Model, PartParams, reconstruct
    from scan2nurbs.pipeline import SurfaceModel, SurfaceParams, reconstruct_surface
    from scan2nurbs.scale import Scale
    from scan2nurbs.surfaces.bspline import BSplineSurface
    from scan2nurbs.surfaces.fit import FitParams, SurfaceFit
    from scan2nurbs.surfaces.relations import RelationParams

__version__ = "0.1.0"

_HOMES = {
    "api": ("detect_edges", "fit_surface", "measure", "segment"),
    "cloud": ("PointCloud", "as_cloud"),
    "edges.boundary": ("BoundaryParams",),
    "edges.detect": ("Edges",),
    "edges.params": ("EdgeParams",),
    "errors": ("InputError", "MissingExtraError", "NoResultError", "OutputError", "ParameterError", "Scan2NurbsError"),
    "faces.corrections": ("FaceCorrections", "read_face_corrections"),
    "faces.region": ("RegionParams",),
    "faces.segmentation": ("Faces", "SegmentParams"),
    "faces.topology": ("TopologyParams",),
    "kernels.runner": ("set_threads",),
    "part": ("Model", "PartParams", "reconstruct"),
    "pipeline": ("SurfaceModel", "SurfaceParams", "reconstruct_surface"),
    "scale": ("Scale",),
    "surfaces.bspline": ("BSplineSurface",),
    "surfaces.fit": ("FitParams", "SurfaceFit"),
    "surfaces.relations": ("RelationParams",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [  # noqa: RUF022 - in the order in which a user meets them
    "detect_edges", "fit_surface", "measure", "reconstruct", "reconstruct_surface", "segment",
    "BoundaryParams", "EdgeParams", "FitParams", "PartParams", "RegionParams", "RelationParams", "SegmentParams",
    "SurfaceParams", "TopologyParams",
    "BSplineSurface", "Edges", "FaceCorrections", "Faces", "Model", "PointCloud", "Scale", "SurfaceFit", "SurfaceModel",
    "as_cloud", "read_face_corrections", "set_threads",
    "InputError", "MissingExtraError", "NoResultError", "OutputError", "ParameterError", "Scan2NurbsError",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'scan2nurbs' has no attribute {name!r}")
    return getattr(import_module(f"scan2nurbs.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
