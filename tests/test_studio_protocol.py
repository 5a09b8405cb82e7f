"""Messages, frames and forms of the studio, and that generated files belong to their sources."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.errors import ParameterError
from scan2nurbs.studio.edits import replay
from scan2nurbs.studio.forms import form_fields
from scan2nurbs.studio.frames import name_of, pack, unpack
from scan2nurbs.studio.messages import Compute, Edit, Trouble, Undo
from scan2nurbs.studio.sources import RECORD, SOURCES, record
from scan2nurbs.studio.typescript import typescript
from scan2nurbs.studio.wire import from_text, to_text
from scan2nurbs.surfaces.relations import RELATIONS

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)
)


def test_messages_come_back_as_they_were():
    assert from_text('{"type": "Undo"}') == Undo()
    assert from_text('{"type": "Compute", "until": "faces"}') == Compute(until="faces")
    assert from_text('{"type": "Edit", "edit": {"face": {"merge": [1, 2]}}}') == Edit(edit={"face": {"merge": [1, 2]}})
    assert json.loads(to_text(Trouble(text="No."))) == {"type": "Trouble", "text": "No."}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        "[" * 100_000,
        '{"type": "Nothing"}',
        '{"type": ["Undo"]}',
        '{"type": "Undo", "more": 1}',
        '{"type": "Compute"}',
        '{"type": "Compute", "until": "heaven"}',
        '{"type": "Compute", "until": {}}',
        '{"type": "Edit", "edit": []}',
        '{"type": "Export", "kind": 3}',
        '{"type": "State"}',
    ],
)
def test_what_is_no_message_is_refused_with_a_sentence(text):
    with pytest.raises(ParameterError) as refused:
        from_text(text)
    assert str(refused.value).endswith(".")


@given(JSON)
def test_no_json_breaks_the_reader(content):
    with pytest.raises(ParameterError):
        from_text(json.dumps(content))


@given(JSON)
def test_no_edit_breaks_the_replay(content):
    with pytest.raises(ParameterError):
        replay([content])


def test_frames_hold_arrays_at_multiples_of_eight():
    arrays = {
        "points": np.arange(9, dtype=np.float32).reshape(3, 3),
        "face": np.array([-1, 2, 3], np.int32),
        "edge": np.array([1, 0, 1], np.uint8),
        "none": np.zeros((0, 3), np.float32),
    }
    frame = pack("cloud", "key", arrays, {"h": 0.5, "nothing": float("nan")})
    header, found = unpack(frame)
    assert name_of(frame) == header["name"] == "cloud"
    assert header["numbers"] == {"h": 0.5, "nothing": None}
    start = len(frame) - sum(-(-array.nbytes // 8) * 8 for array in arrays.values())
    assert start % 8 == 0
    assert all(info["offset"] % 8 == 0 for info in header["arrays"])
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype


def test_forms_explain_every_parameter():
    fields = form_fields()
    assert len({(field.stage, field.name) for field in fields}) == len(fields) > 20
    for field in fields:
        assert len(field.help) > 15, field.name
        assert field.help.endswith((".", ")."))
        assert field.automatic == (field.default is None)
    by_name = {f"{field.stage}.{field.name}": field for field in fields}
    threshold = by_name["edges.threshold"]
    assert (threshold.low, threshold.high, threshold.unit, threshold.kind) == (0.0, 90.0, "°", "number")
    assert (by_name["segment.min_points"].low, by_name["segment.min_points"].kind) == (6.0, "integer")
    assert by_name["segment.tolerance"].unit == "unit"
    assert by_name["topology.fill_holes"].kind == "flag"
    assert (by_name["relations.angle"].low, by_name["relations.angle"].unit, by_name["relations.angle"].step) == (0.0, "°", "surfaces")
    assert (by_name["relations.kinds"].kind, tuple(by_name["relations.kinds"].choices)) == ("choices", RELATIONS)
    assert "cylinder" in by_name["segment.keep_types"].choices
    assert {field.step for field in fields} == {"scan", "edges", "faces", "surfaces", "model"}


def test_the_defaults_of_a_form_are_those_of_the_stages():
    edits = [{"set": {"stage": field.stage, "name": field.name, "value": None}} for field in form_fields()]
    assert replay(edits) == replay([])


def test_the_types_of_the_page_are_those_of_the_messages():
    assert (SOURCES / "src" / "messages.ts").read_text(encoding="utf-8") == typescript(), "run studio-web/build.sh"


def test_the_built_page_is_that_of_its_source():
    assert RECORD.read_text(encoding="utf-8") == record(), "run studio-web/build.sh"


def test_the_page_asks_nobody_else_for_anything():
    static = RECORD.parent
    page = (static / "index.html").read_text(encoding="utf-8")
    style = "".join(path.read_text(encoding="utf-8") for path in (static / "assets").glob("*.css"))
    assert "http:" not in page + style
    assert "https:" not in page + style
    assert "<script>" not in page
    assert " style=" not in page


def test_modules_of_the_page_are_small():
    lines = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in Path(SOURCES / "src").rglob("*.ts")}
    assert {name: n for name, n in lines.items() if n > 400} == {}
