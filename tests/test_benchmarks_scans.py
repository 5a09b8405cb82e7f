"""The table of real scans, on files of our own: a surface, a file that is no scan, points without a surface."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks import scans


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scans")
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    z = np.where(np.hypot(x - 15, y - 15) < 9, 5.0, 0.0) + np.random.default_rng(0).normal(0, 0.1, x.shape)
    np.savetxt(folder / "plateau.xyz", np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    np.savetxt(folder / "circle.xyz", np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))
    (folder / "letter.ply").write_text("Dear reader,\n", encoding="utf-8")
    (folder / ".hidden.ply").write_text("", encoding="utf-8")
    return folder


def test_every_scan_becomes_a_row_of_both_tables(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scans, "warm_up", lambda folder: None)
    page = tmp_path / "page.md"
    page.write_text(f"# Title\n\nBefore.\n\n{scans.BEGIN}\nold\n{scans.END}\n\nAfter.\n", encoding="utf-8")
    assert scans.main([str(folder), "-o", str(page), "--keep", str(tmp_path / "kept")]) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Title\n\nBefore.")
    assert text.endswith("After.\n")
    assert "old" not in text
    assert capsys.readouterr().out.strip() in text
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")]
    made = {row[0]: row for row in rows[rows.index(next(row for row in rows if row[1] == "exit code")) + 2 :]}
    assert set(made) == {"plateau.xyz", "circle.xyz", "letter.ply"}
    assert [made[name][1] for name in ("plateau.xyz", "circle.xyz", "letter.ply")] == ["0", "4", "3"]
    assert made["plateau.xyz"][9] == "yes"
    assert (tmp_path / "kept" / "plateau.xyz.step").exists()
    assert str(folder) not in text


def test_a_command_that_does_not_end_is_reported(folder: Path) -> None:
    one = scans.run("info", folder / "plateau.xyz", limit=0.01)
    assert one.code is None
    assert "No end within" in one.error


def test_a_page_without_marks_gets_them() -> None:
    page = scans.put("# Title\n", "first")
    assert scans.put(page, "second") == page.replace("first", "second")
