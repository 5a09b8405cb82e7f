"""Corrections of faces: what the steps do, and what bad files are told."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scan2nurbs.errors import InputError
from scan2nurbs.faces.corrections import apply_face_corrections, read_face_corrections

POINTS = np.stack([np.arange(12.0), np.zeros(12), np.zeros(12)], axis=1)
LABEL = np.repeat(np.arange(4, dtype=np.int32), 3)
SPLIT = {"face": 1, "boxes": [{"min": [4.5, None, None], "max": [100, None, None]}]}


def done(tmp_path, steps, label=LABEL):
    """Write the steps into a file, read it, and do them."""
    path = tmp_path / "corrections.json"
    path.write_text(json.dumps(steps), encoding="utf-8")
    return apply_face_corrections(label, read_face_corrections(path), lambda selection: selection.of(POINTS))


def test_merging_keeps_the_number_named_first(tmp_path):
    result = done(tmp_path, [{"merge": [3, 1]}])
    assert result.label.tolist() == [0, 0, 0, 3, 3, 3, 2, 2, 2, 3, 3, 3]
    assert result.changed == {3}


def test_splitting_gives_the_next_free_number(tmp_path):
    result = done(tmp_path, [{"split": SPLIT}, {"merge": [4, 0]}])
    assert result.label.tolist() == [4, 4, 4, 1, 1, 4, 2, 2, 2, 3, 3, 3]
    assert result.changed == {1, 4}


def test_a_number_never_passes_to_another_face(tmp_path):
    steps = [{"delete": 3}, {"split": SPLIT}, {"type": {"face": 2, "kind": "cylinder"}}]
    result = done(tmp_path, steps)
    assert result.label.tolist() == [0, 0, 0, 1, 1, 4, 2, 2, 2, -1, -1, -1]
    assert result.forced == {2: "cylinder"}
    assert result.free == 5
    assert done(tmp_path, [{"split": SPLIT}, {"merge": [1, 4]}, {"delete": 3}]).free == 5


def test_a_tolerance_goes_with_its_number(tmp_path):
    given = [{"tolerance": {"face": face, "value": value}} for face, value in ((1, 0.5), (2, 1), (3, 2.0), (1, 0.25))]
    result = done(tmp_path, [*given, {"merge": [1, 2]}, {"delete": 3}, {"type": {"face": 1, "kind": "plane"}}])
    assert result.tolerances == {1: 0.25}
    assert result.forced == {1: "plane"}


def test_assigning_moves_points_to_a_face_or_to_none(tmp_path):
    result = done(tmp_path, [{"assign": {"face": 0, "indices": [3]}}, {"assign": {"face": -1, "indices": [0]}}])
    assert result.label.tolist() == [-1, 0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 3]
    assert result.changed == {0, 1}


def test_what_is_given_stays_as_it_was(tmp_path):
    before = LABEL.copy()
    done(tmp_path, [{"merge": [0, 1]}, {"delete": 2}])
    np.testing.assert_array_equal(before, LABEL)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=6))
def test_merging_changes_no_other_face(tmp_path_factory, pairs):
    steps = [{"merge": [a, b]} for a, b in pairs if a != b]
    alive, kept = set(range(4)), []
    for step in steps:
        if set(step["merge"]) <= alive:
            kept.append(step)
            alive.discard(step["merge"][1])
    result = done(tmp_path_factory.mktemp("merge"), kept)
    assert set(result.label.tolist()) == alive
    assert (result.label[min(alive) == LABEL] == min(alive)).all()


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ({"merge": [0, 1]}, "list of steps"),
        ([{"join": [0, 1]}], "one key of merge"),
        ([{"merge": [0, 1], "delete": 2}], "one key of merge"),
        ([{"merge": [0]}], "at least two faces"),
        ([{"merge": [0, 0]}], "two faces that are not the same"),
        ([{"assign": {"face": 0, "boxes": [{"min": [90, 90, 90], "max": [91, 91, 91]}]}}], "holds no point"),
        ([{"merge": [0, -1]}], "must be a number as the report has it"),
        ([{"merge": [0, 9]}], "Step 1 .merge.: there is no face 9"),
        ([{"delete": 2}, {"delete": 2}], "Step 2 .delete.: there is no face 2"),
        ([{"delete": True}], "must be a number as the report has it"),
        ([{"type": {"face": 1, "kind": "cube"}}], 'needs a "face" and a "kind"'),
        *[
            ([{"tolerance": said}], 'Step 1: "tolerance" needs a "face" and a "value" > 0')
            for said in (
                {"face": 1},
                {"face": 1, "value": 0},
                {"face": 1, "value": -0.1},
                {"face": 1, "value": True},
                {"face": 1, "value": "0.1"},
                {"face": 1, "value": float("nan")},
                {"face": 1, "value": float("inf")},
                {"face": 1, "value": 10**400},
                {"face": 1, "value": 0.1, "kind": "plane"},
            )
        ],
        ([{"tolerance": 0.1}], 'must be an object that names a "face"'),
        ([{"tolerance": {"value": 0.1}}], "must be a number as the report has it"),
        ([{"delete": 2}, {"tolerance": {"face": 2, "value": 0.1}}], "Step 2 .tolerance.: there is no face 2"),
        ([{"type": 1}], 'must be an object that names a "face"'),
        ([{"split": {"face": 0, "indices": [5]}}], "does not divide face 0"),
        ([{"split": {"face": 0, "indices": [0, 1, 2]}}], "does not divide face 0"),
        ([{"split": {"face": 0, "rows": [0]}}], "unknown key 'rows'"),
        ([{"assign": {"face": -2, "indices": [0]}}], "must be a number as the report has it"),
    ],
)
def test_a_bad_step_is_named(tmp_path, steps, said):
    with pytest.raises(InputError, match=said) as caught:
        done(tmp_path, steps)
    assert caught.value.path == tmp_path / "corrections.json"


@pytest.mark.parametrize("text", ["", "[", "{}}", "\x00"])
def test_a_file_that_is_no_json_is_named(tmp_path, text):
    path = tmp_path / "corrections.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="file of corrections is not valid JSON"):
        read_face_corrections(path)
    with pytest.raises(InputError, match="file of corrections cannot be read"):
        read_face_corrections(tmp_path / "none")
