"""Results of stages as plain data and arrays, and back: known dataclasses by their fields, nothing that is run when it is read."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.border import Borders
from scan2nurbs.edges.detect import Edges
from scan2nurbs.faces.complex import Border, LabelledMesh, Topology
from scan2nurbs.faces.segmentation import Faces
from scan2nurbs.part_faces import Parted
from scan2nurbs.studio.messages import FaceEntry, Figure, StepResult
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.extrusion import Extrusion
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.profile import PlanarCurve
from scan2nurbs.surfaces.relations import Related, Relation
from scan2nurbs.surfaces.revolution import Revolution
from scan2nurbs.surfaces.shape_result import ShapeFit
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.spline_shape import SplineShape
from scan2nurbs.surfaces.torus import Torus

Arrays = list[NDArray[Any]]

_SHAPES: tuple[type, ...] = (Plane, Cylinder, Cone, Sphere, Torus, Extrusion, Revolution, PlanarCurve, SplineShape, BSplineSurface)
_STAGES: tuple[type, ...] = (Borders, Edges, Faces, ShapeFit, Parted, Related, Relation, Topology, Border, LabelledMesh)
_SEEN: tuple[type, ...] = (StepResult, Figure, FaceEntry)
_CLASSES: dict[str, Any] = {cls.__name__: cls for cls in (*_SHAPES, *_STAGES, *_SEEN)}
_ARRAYS = "biuf"
"""Kinds of arrays: truth values and numbers."""
_FROM_ARRAY: dict[str, Callable[[NDArray[Any]], Any]] = {
    "array": lambda array: array,
    "number": lambda array: array[()],
    "bytes": lambda array: array.tobytes(),
}
_FROM_ITEMS: dict[str, Callable[[Iterable[Any]], Any]] = {"list": list, "tuple": tuple, "frozenset": frozenset}


def encode(value: Any, results: Mapping[str, Any], arrays: Arrays) -> Any:
    """Return a result as what JSON can say; its arrays are appended to `arrays`.

    Parameters
    ----------
    value : object
    results : dict of str to object
        Other results by name; where one of them is a part of `value`, its name stands for it.
    arrays : list of array

    Raises
    ------
    TypeError
        If there is something in it that is neither number, text, array, nor one of the known dataclasses.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    for name, result in results.items():
        if value is result:
            return {"result": name}
    kind, array = _as_array(value)
    if array is not None:
        arrays.append(array)
        return {kind: len(arrays) - 1}
    if type(value) in (list, tuple, frozenset):
        return {kind: [encode(item, results, arrays) for item in value]}
    if type(value) is dict:
        return {kind: [[encode(key, results, arrays), encode(item, results, arrays)] for key, item in value.items()]}
    if _CLASSES.get(kind) is not type(value):
        raise TypeError(f"{kind} cannot be kept in a file")
    return {kind: {field.name: encode(getattr(value, field.name), results, arrays) for field in dataclasses.fields(value)}}


def _as_array(value: Any) -> tuple[str, NDArray[Any] | None]:
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in _ARRAYS:
        return "array" if isinstance(value, np.ndarray) else "number", np.asarray(value)
    return type(value).__name__, np.frombuffer(value, np.uint8) if type(value) is bytes else None


def decode(said: Any, results: Mapping[str, Any], arrays: Arrays) -> Any:
    """Return what `encode` was given.

    Raises
    ------
    Exception
        Of any kind, where `said` is not what `encode` gave.
    """
    if not isinstance(said, dict):
        return said
    ((kind, content),) = said.items()
    if kind == "result":
        return results[content]
    if kind in _FROM_ARRAY:
        return _FROM_ARRAY[kind](arrays[content])
    if kind in _FROM_ITEMS:
        return _FROM_ITEMS[kind](decode(item, results, arrays) for item in content)
    if kind == "dict":
        return {decode(key, results, arrays): decode(item, results, arrays) for key, item in content}
    return _CLASSES[kind](**{name: decode(item, results, arrays) for name, item in content.items()})
