"""The report: its JSON, its page and its pictures."""

from __future__ import annotations

import dataclasses
import enum
import io
import json
import re
import time
from html.parser import HTMLParser
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from scan2nurbs.report import pictures
from scan2nurbs.report.html import render_html, shown
from scan2nurbs.report.record import Stopwatch, peak_memory_mb, plain, to_json, versions
from scan2nurbs.report.view import View, choose_view, rasterise


@dataclasses.dataclass(frozen=True)
class Result:
    """Anything a stage returns."""

    values: np.ndarray
    ratio: float = float("nan")


class Kind(enum.Enum):
    """Any choice."""

    PLANE = "plane"


class TestRecord:
    def test_everything_a_stage_returns_becomes_json(self):
        record = {
            "result": Result(np.array([1.0, np.inf, np.nan])),
            "mask": np.array([True, False]),
            "n": np.int64(3),
            "x": np.float32(0.5),
            "kind": Kind.PLANE,
            "path": Path("a") / "b",
            "names": {"b", "a"},
            "pair": (1, None),
            4: "key",
        }
        assert json.loads(to_json(record)) == {
            "result": {"values": [1.0, None, None], "ratio": None},
            "mask": [True, False],
            "n": 3,
            "x": 0.5,
            "kind": "plane",
            "path": str(Path("a/b")),
            "names": ["a", "b"],
            "pair": [1, None],
            "4": "key",
        }

    def test_numbers_keep_their_digits(self):
        assert json.loads(to_json({"x": np.float64(0.1) + 0.2}))["x"] == 0.1 + 0.2

    def test_what_has_no_json_is_refused(self):
        with pytest.raises(TypeError, match="object"):
            plain(object())

    def test_versions_and_memory(self):
        assert re.match(r"\d+\.\d+", versions()["numpy"])
        peak = peak_memory_mb()
        assert peak is not None
        held = np.ones(30_000_000)  # 240 MB
        grown = peak_memory_mb()
        assert grown is not None
        assert grown >= peak
        assert grown > held.nbytes / 1e6

    def test_a_stage_that_runs_twice_is_added_up(self):
        watch = Stopwatch()
        for _ in range(2):
            with watch("fit"):
                time.sleep(0.01)
        assert 0.02 <= watch.seconds["fit"] < 2


def sheet(n: int = 6000) -> np.ndarray:
    """A flat, wide sheet far from zero."""
    rng = np.random.default_rng(1)
    across, upwards = rng.uniform(-1, 1, (2, n))
    return np.stack([100 + 3 * across, upwards - 50, rng.normal(7, 0.01, n)], axis=1)


class TestView:
    @pytest.mark.parametrize("turn", [np.eye(3), np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])])
    def test_a_sheet_is_seen_on_its_broad_side(self, turn):
        points = sheet() @ turn.T
        view = choose_view(points)
        np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(view.axes) == pytest.approx(1.0)
        assert abs(view.axes[2] @ turn[:, 2]) > 0.8

    def test_strays_do_not_shrink_the_part(self):
        points = sheet()
        with_stray = np.vstack([points, [[1e6, 1e6, 1e6]]])
        size, same = (view.high - view.low for view in (choose_view(points), choose_view(with_stray)))
        np.testing.assert_allclose(same, size, rtol=0.1)

    def test_the_scale_of_the_coordinates_does_not_matter(self):
        small, large = choose_view(sheet() * 1e-9), choose_view(sheet() * 1e9)
        np.testing.assert_allclose(small.axes, large.axes, atol=1e-6)

    def test_nearer_points_hide_farther_ones(self):
        points = sheet()
        view = choose_view(points)
        behind = points - 0.5 * view.axes[2]
        raster = rasterise(np.vstack([behind, points]), view, width=120, height=60)
        seen = raster.index[raster.index >= 0]
        assert (seen >= len(points)).mean() > 0.95
        assert raster.shade.min() >= 0
        assert raster.shade.max() <= 1

    @pytest.mark.parametrize("seed", range(3))
    def test_nothing_shines_through_between_scattered_points(self, seed):
        rng = np.random.default_rng(seed)
        front = np.column_stack([rng.uniform(-1, 1, (4000, 2)), np.zeros(4000)])
        back = front * [1, 1, 0] - [0, 0, 0.5]
        view = View(np.eye(3), np.full(2, -1.2), np.full(2, 1.2))
        raster = rasterise(np.vstack([front, back[:, [1, 0, 2]]]), view, width=480, height=480)
        inside = raster.index[60:-60, 60:-60]
        assert inside.min() >= 0
        assert inside.max() < len(front)
        assert raster.index[:30].max() == -1

    def test_a_hole_wider_than_gaps_stays_open(self):
        points = np.column_stack([np.random.default_rng(4).uniform(-1, 1, (20000, 2)), np.zeros(20000)])
        points = points[np.hypot(*points[:, :2].T) > 0.2]
        raster = rasterise(points, View(np.eye(3), np.full(2, -1.1), np.full(2, 1.1)), width=440, height=440)
        middle = raster.index[190:250, 190:250]
        assert (middle == -1).mean() > 0.75

    @pytest.mark.parametrize("points", [np.eye(3), np.outer([0, 1, 2.0], [1, 1, 1]), np.full((5, 3), 2.0)])
    def test_degenerate_clouds_are_drawn_too(self, points):
        drawn = pictures.groups_picture(points, {}, title="few", caption="", unit="mm")
        assert drawn.png.startswith(b"\x89PNG")


class TestPictures:
    def image(self, picture: pictures.Picture) -> np.ndarray:
        return matplotlib.image.imread(io.BytesIO(picture.png))

    def test_the_strength_shows_in_colour(self):
        points = sheet()
        strength = np.where(points[:, 0] > 100, 60.0, 1.0)
        strength[:50] = np.nan
        image = self.image(pictures.strength_picture(points, strength, unit="mm", threshold=20.0))
        flat = image[..., :3].reshape(-1, 3)
        yellow, violet = (flat[:, 0] > 0.5) & (flat[:, 2] < 0.3), (flat[:, 2] > flat[:, 1] + 0.1) & (flat.sum(axis=1) < 1.2)
        assert yellow.mean() > 0.03
        assert violet.mean() > 0.03

    def test_the_deviation_is_red_above_and_blue_below(self):
        points = sheet()
        deviation = np.where(points[:, 0] > 100, 0.5, -0.5)
        flat = self.image(pictures.deviation_picture(points, deviation, unit="mm", tolerance=0.1))[..., :3].reshape(-1, 3)
        assert (flat[:, 0] > flat[:, 2] + 0.3).mean() > 0.05
        assert (flat[:, 2] > flat[:, 0] + 0.3).mean() > 0.05

    def test_all_values_undefined(self):
        points = sheet(500)
        nothing = np.full(500, np.nan)
        for picture in (
            pictures.strength_picture(points, nothing, unit="mm"),
            pictures.deviation_picture(points, nothing, unit="mm"),
            pictures.deviation_histogram(nothing, unit="mm"),
        ):
            assert picture.png.startswith(b"\x89PNG")

    def test_groups_and_curves(self):
        points = sheet()
        ring = np.stack([100 + np.cos(t := np.linspace(0, 6.3, 50)), -50 + 0.5 * np.sin(t), 7 + 0 * t], axis=1)
        inside = np.hypot(points[:, 0] - 100, 2 * (points[:, 1] + 50)) < 1
        picture = pictures.groups_picture(points, {"inside": inside}, title="t", caption="c", unit="mm", curves=[ring])
        flat = self.image(picture)[..., :3].reshape(-1, 3)
        assert (flat[:, 2] > flat[:, 0] + 0.3).mean() > 0.03
        surface = pictures.surface_picture(points, [ring], [ring + 0.1], unit="mm")
        assert self.image(surface).shape[1] > 600

    def test_the_same_data_give_the_same_bytes(self):
        deviation = sheet()[:, 2] - 7
        one, other = (pictures.deviation_histogram(deviation, unit="mm", noise=0.01, tolerance=0.03).png for _ in range(2))
        assert one == other

    @pytest.mark.parametrize(("length", "rounded"), [(1.0, 1.0), (0.0499, 0.02), (7e6, 5e6), (2.0, 2.0), (0.0, 1.0)])
    def test_scale_bars_are_round(self, length, rounded):
        assert pictures._round_down(length) == pytest.approx(rounded)


class References(HTMLParser):
    """Collects what a page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.scripts += tag == "script" and values.get("type") != "application/json"
        self.found += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]


RECORD = {
    "schema": "scan2nurbs/edges/1",
    "input": {"path": "dir/<b>evil</b> & scan.ply", "unit": "mm", "n_points": 1234567},
    "scale": {"spacing": 0.123456, "noise": float("nan")},
    "edges": {"runs": [{"operator": "dn", "n_kept": 3}], "radii": {"small": 1.5}},
    "faces": [{"face": 0, "type": "plane"}, {"face": 1, "type": "</script>"}],
    "parameters": {"edges": {"operator": "edn", "beta": None}},
    "warnings": ["Beware of <i>this</i>."],
    "seconds": {"edges": 0.25},
    "peak_memory_mb": 99.0,
    "outputs": ["out.ply"],
    "versions": {"python": "3.11"},
}


class TestPage:
    def test_the_page_stands_alone(self):
        picture = pictures.Picture("A title", "A caption", b"\x89PNG...")
        page = render_html(RECORD, [picture], [("edge points", "3")])
        references = References()
        references.feed(page)
        assert references.scripts == 0
        assert references.found
        assert all(reference.startswith("data:image/png;base64,") for reference in references.found)
        assert "http" not in page

    def test_it_says_everything(self):
        page = render_html(RECORD, [pictures.Picture("A title", "A caption", b"")], [("edge points", "3")])
        for text in (
            "A title",
            "A caption",
            "edge points",
            "1\u202f234\u202f567",
            "0.1235",
            "operator",
            "out.ply",
            "3.11",
            "scan2nurbs edges",
            "mm",
        ):
            assert text in page

    def test_names_from_outside_cannot_become_markup(self):
        page = render_html(RECORD)
        assert "<b>evil" not in page
        assert "<i>this" not in page
        assert page.count("</script>") == 1

    def test_the_json_inside_is_the_json(self):
        page = render_html(RECORD)
        raw = page.split('id="record">')[1].split("</script>")[0]
        assert json.loads(raw) == plain(RECORD)

    def test_a_record_of_nothing_is_a_page_too(self):
        assert "</html>" in render_html({})

    @pytest.mark.parametrize(
        ("value", "text"),
        [(None, "–"), (True, "yes"), (0.000123456, "0.0001235"), (-3, "-3"), ([], "–"), ([1.0, 2.0], "1, 2"), ({"n_kept": 3}, "n kept 3")],
    )
    def test_values_read_well(self, value, text):
        assert shown(value) == text

    def test_long_lists_are_cut(self):
        assert shown(list(range(100))).endswith("… (100)")
