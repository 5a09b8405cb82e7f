"""Blends of freeform faces, told from what they round; long chains of pieces; swept surfaces of pieces."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.faces.blends import Border, find_blends
from scan2nurbs.faces.gather import Pairs, gather, groups
from scan2nurbs.faces.segmentation import SegmentParams, segment_points
from scan2nurbs.scale import measure_scale

NOISE = 0.25
SIZE = np.full(6, 60)
"""Points of six pieces, few for the length of their borders: long strips."""


def segment(points):
    scale = measure_scale(points)
    return segment_points(points, scale, detect(points, scale, EdgeParams()), SegmentParams())


def places(across, along, rng):
    """Jittered places (N, 2), one per unit of area."""
    u, v = np.meshgrid(np.arange(0.5, across), np.arange(0.5, along), indexing="ij")
    return np.c_[u.ravel(), v.ravel()] + rng.uniform(-0.25, 0.25, (u.size, 2))


def rounded_edge(radius, rng):
    """Top, blend and wall of an edge, bent so that none is a primitive: points (N, 3) and the true face of each."""
    parts = []
    for k, across in enumerate((60.0, 0.5 * np.pi * radius, 60.0)):
        s, x = places(round(across), 110, rng).T
        angle = s / radius
        y, z = (
            (s - 60.0, np.zeros_like(s)),
            (radius * np.sin(angle), radius * (np.cos(angle) - 1.0)),
            (np.full_like(s, radius), -radius - s),
        )[k]
        parts.append(np.c_[x, y, z])
    x, y, z = np.concatenate(parts).T
    bent = np.c_[x, y + 4.0 * np.sin(x / 16.0) - 0.005 * z**2, z + 4.0 * np.cos(x / 14.0) - 0.006 * np.minimum(y, 0.0) ** 2]
    return bent + rng.normal(scale=NOISE, size=bent.shape), np.repeat([0, 1, 2], [len(p) for p in parts])


def test_a_blend_between_freeform_faces_is_a_face():
    points, truth = rounded_edge(11.0, np.random.default_rng(4))
    label = segment(points).label
    main = []
    for k in range(3):
        own = np.bincount(label[(truth == k) & (label >= 0)])
        main.append(int(own.argmax()))
        assert own.max() > 0.9 * np.sum(truth == k)
    assert len(set(main)) == 3


def border(sharper, flatter, bend, other, points=50):
    return Border(sharper, flatter, bend, other, points)


def test_a_blend_bends_evenly_and_more_than_its_neighbours():
    around = [border(b, face, bend, 0.005) for b, bend in ((2, 0.09), (3, 0.1), (4, 0.105)) for face in (0, 1)]
    chain = [border(3, 2, 0.02, 0.018), border(4, 3, 0.02, 0.018)]
    assert find_blends([*around, *chain], SIZE, NOISE).of == {2: 0, 3: 0, 4: 0}


def test_an_edge_that_is_rounded_unevenly_is_none():
    """As the leading edge of a wing, whose radius changes all along."""
    around = [border(b, face, bend, 0.005) for b, bend in ((2, 0.05), (3, 0.1), (4, 0.2)) for face in (0, 1)]
    assert find_blends([*around, border(3, 2, 0.02, 0.018), border(4, 3, 0.02, 0.018)], SIZE, NOISE).of == {}


def test_a_patch_that_bends_more_than_its_neighbours_is_none():
    """As the tip of an ear: it is as long as wide."""
    around = [border(2, 0, 0.1, 0.01), border(2, 1, 0.1, 0.01)]
    assert find_blends(around, SIZE, NOISE).of == {2: 0}
    assert find_blends(around, 4 * SIZE, NOISE).of == {}


def test_a_step_on_the_way_to_a_sharper_bend_is_none():
    around = [border(1, 0, 0.05, 0.01), border(2, 1, 0.2, 0.05)]
    assert 1 not in find_blends(around, SIZE, NOISE).of


def test_bends_that_noise_may_hide_are_no_evidence():
    around = [border(2, 0, 0.02, 0.0), border(2, 1, 0.02, 0.0)]
    assert find_blends(around, SIZE, NOISE).of == {}
    assert find_blends(around, SIZE, 0.1).of == {2: 0}


def test_a_blend_is_divided_where_the_faces_that_it_rounds_change():
    """Pieces 3 and 4 lie between top 0 and wall 1, 5 between top and wall 2."""
    around = [border(b, face, 0.1, 0.004) for b, wall in ((3, 1), (4, 1), (5, 2)) for face in (0, wall)]
    blends = find_blends([*around, border(4, 3, 0.02, 0.018), border(5, 4, 0.02, 0.018)], SIZE, NOISE)
    parent = np.arange(6)
    assert blends.round_alike((3, 4), parent)
    assert not blends.round_alike((4, 5), parent)
    assert blends.round_alike((4, 5), np.array([0, 1, 1, 3, 4, 5]))  # both walls are one face
    freeform = np.array([False, True, False, False, False, False])
    assert blends.rounds_any((3, 4), parent, freeform)
    assert not blends.rounds_any((3, 5), parent, ~np.ones(6, bool))
    assert blends.part((0, 3))
    assert not blends.part((4, 5))


def known(pairs, doubt=0.5, even=True):
    return Pairs(reach=dict.fromkeys(pairs, (1.2, 1.3)), doubt=dict.fromkeys(pairs, doubt), even=frozenset(pairs) if even else frozenset())


@pytest.mark.parametrize("pieces", [5, 6])
def test_only_long_chains_of_arcs_are_gathered(pieces):
    pairs = [(k, k + 1) for k in range(pieces - 1)]
    size, flat = np.full(pieces, 100), np.zeros(pieces, bool)
    whole = [list(range(pieces))] if pieces >= 6 else []
    assert groups(gather(size, flat, known(pairs), pairs, pairs)) == whole
    assert groups(gather(size, flat, known(pairs, even=False), pairs, pairs)) == []


def test_a_plane_in_two_pieces_does_not_spread_as_a_freeform_face():
    """Pieces 0 and 1 are one plane; 2 and 3 a freeform face that meets it, but does not run on over it."""
    pairs = [(0, 1), (1, 2), (2, 3)]
    about = Pairs(reach={(0, 1): (1.0, 1.1), (1, 2): (4.5, 4.5), (2, 3): (1.0, 1.1)}, doubt=dict.fromkeys(pairs, np.inf), even=frozenset())
    size = np.array([500, 100, 200, 100])
    assert groups(gather(size, np.array([True, True, False, False]), about, pairs, pairs)) == [[0, 1], [2, 3]]
    assert groups(gather(size, np.zeros(4, bool), about, pairs, pairs)) == [[0, 1, 2, 3]]


@pytest.mark.parametrize(("flat", "even", "whole"), [(False, True, True), (True, True, False), (False, False, False)])
def test_a_freeform_face_goes_on_over_what_bends_alike_but_not_over_planes(flat, even, whole):
    """Pieces 0 and 1 are freeform for certain; 2 is tangent to 1, and as large."""
    pairs = [(0, 1), (1, 2)]
    about = Pairs(reach=dict.fromkeys(pairs, (1.2, 2.5)), doubt={(0, 1): 9.0, (1, 2): 0.5}, even=frozenset({(1, 2)} if even else set()))
    found = groups(gather(np.full(3, 100), np.array([False, False, flat]), about, pairs, pairs[:1]))
    assert found == [[0, 1, 2] if whole else [0, 1]]


@pytest.mark.parametrize("seed", [6])
def test_a_revolved_profile_is_one_face(seed):
    """It is cut into tori and cones first, nearly all of them tangent."""
    rng = np.random.default_rng(seed)
    s, t = places(70, 240, rng).T
    radius, angle = 38.0 + 6.0 * np.sin(s / 12.0) + 0.1 * s, t / 240.0 * 2.0 * np.pi
    points = np.c_[radius * np.cos(angle), radius * np.sin(angle), s]
    faces = segment(points + rng.normal(scale=NOISE, size=points.shape))
    size = np.bincount(faces.label[faces.label >= 0])
    assert faces.fits[0].shape.kind == "revolution"
    assert size[0] > 0.85 * len(points)  # an end that looks like a cone may stay one
