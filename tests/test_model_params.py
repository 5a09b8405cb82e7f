"""What models may be asked for."""

import pytest

from scan2nurbs.brep.part import ModelParams
from scan2nurbs.errors import ParameterError


@pytest.mark.parametrize("name", ["widest", "bearable", "reach"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_parameters_of_models_are_lengths(name, value):
    with pytest.raises(ParameterError, match=f"'{name}' parameter of build_part"):
        ModelParams(**{name: value})
