"""The parts that are drawn by chance, and their measuring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks import chance
from benchmarks.truth import true_part
from examples.parts.chance import BLANKS, by_chance

from scan2nurbs.brep.check import is_valid


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_every_seed_gives_a_valid_part_of_its_own(seed: int) -> None:
    shape, names = by_chance(seed)
    assert is_valid(shape)
    assert names[0] in BLANKS
    assert len(true_part(shape).faces) > 6


def test_a_seed_gives_the_same_part_again() -> None:
    (one, names), (other, again) = by_chance(7), by_chance(7)
    assert names == again
    assert len(true_part(one).faces) == len(true_part(other).faces)
    assert len({tuple(by_chance(seed)[1]) for seed in range(1, 9)}) > 5


def test_the_page_names_every_part_with_its_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    assert chance.main(["--seeds", "1", "--points", "6000", "--output", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| seed")]
    assert [row[0] for row in rows] == ["seed 1"]
    assert 0.0 < float(rows[0][4]) <= 1.0
    assert f"**seed 1**: {by_chance(1)[1][0]}" in text
    assert np.isfinite(float(rows[0][-1]))
    assert rows[0][0] in capsys.readouterr().out
