"""Parameters of the wrong type or out of range are told by name, wherever they are given."""

from __future__ import annotations

import numpy as np
import pytest

import scan2nurbs
from scan2nurbs.brep.part import ModelParams
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.region import RegionParams
from scan2nurbs.faces.segmentation import SegmentParams
from scan2nurbs.faces.topology import TopologyParams
from scan2nurbs.kernels.runner import set_threads, thread_count
from scan2nurbs.part import PartParams, reconstruct
from scan2nurbs.pipeline import SurfaceParams, reconstruct_surface
from scan2nurbs.simulate.scan import simulate_scan
from scan2nurbs.surfaces.fit import FitParams
from scan2nurbs.surfaces.relations import RelationParams

WRONG = [
    (SegmentParams, "max_faces", 2.5),
    (SegmentParams, "max_faces", "3"),
    (SegmentParams, "max_faces", True),
    (SegmentParams, "tolerance", "wide"),
    (SegmentParams, "tolerance", float("nan")),
    (SegmentParams, "min_points", 5),
    (SegmentParams, "most_points", 1e4),
    (SegmentParams, "keep_types", "plane"),
    (SegmentParams, "keep_types", ()),
    (SegmentParams, "keep_types", (["plane"],)),
    (TopologyParams, "reach", 0.5),
    (TopologyParams, "max_points", 2000.5),
    (ModelParams, "widest", None),
    (ModelParams, "reach", float("inf")),
    (RelationParams, "angle", "small"),
    (RelationParams, "max_rise", -1.0),
    (RegionParams, "seed", (1.0, 2.0)),
    (RegionParams, "seed", "here"),
    (RegionParams, "min_points", 30.0),
    (FitParams, "tolerance", 0.0),
    (FitParams, "max_iterations", 1.5),
    (FitParams, "smoothness", "fair"),
    (EdgeParams, "sectors", 4.0),
    (PartParams, "segment", EdgeParams()),
    (PartParams, "relation_params", None),
    (SurfaceParams, "fit", {"degree": 3}),
]


@pytest.mark.parametrize(("params", "name", "value"), WRONG)
def test_a_parameter_of_the_wrong_type_or_out_of_range_is_named(params, name, value):
    with pytest.raises(ParameterError, match=name):
        params(**{name: value})


def test_numbers_of_numpy_are_numbers():
    assert SegmentParams(max_faces=np.int64(3), tolerance=np.float32(0.5)).max_faces == 3
    assert TopologyParams(max_points=np.int32(5000), reach=np.float64(2.0)).reach == 2.0


@pytest.mark.parametrize(
    ("call", "params"), [(reconstruct, SurfaceParams()), (reconstruct_surface, PartParams()), (simulate_scan, EdgeParams())]
)
def test_parameters_of_another_function_are_refused(call, params):
    with pytest.raises(ParameterError, match="params"):
        call(np.zeros((10, 3)), params)


def test_threads_are_a_whole_number_of_them():
    before = thread_count()
    for wrong in (0, 1.5, True, "2"):
        with pytest.raises(ParameterError, match="threads"):
            set_threads(wrong)
    assert thread_count() == before
    assert scan2nurbs.set_threads is set_threads
