"""What the documentation shows works, and what works is documented."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from scan2nurbs.cli.main import COMMANDS, load, main

ROOT = Path(__file__).parent.parent
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!https?://|#)([^)#]+)")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty working folder with the scan that the pages speak of: a round, shallow dome standing out of a plane by a wall."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-20, 20, (2, 12_000))
    inside = np.hypot(x, y) < 12
    z = np.where(inside, 6 - (x**2 + y**2) / 80, 0.0)
    turn, height = rng.uniform(0, 2 * np.pi, 1500), rng.uniform(0, 4.2, 1500)
    wall = np.stack([12 * np.cos(turn), 12 * np.sin(turn), height], axis=1)
    points = np.vstack([np.stack([x, y, z], axis=1), wall])
    (tmp_path / "scan.xyz").write_text("\n".join(" ".join(f"{v:.5f}" for v in row) for row in points + rng.normal(0, 0.02, points.shape)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", ["docs/api.md", "README.md"])
def test_the_python_of_a_page_runs(page, folder):
    names: dict[str, object] = {}
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), names)


@pytest.mark.parametrize("page", sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]), ids=lambda path: path.name)
def test_links_between_pages_lead_somewhere(page):
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / link).exists(), link


def test_the_readme_says_what_the_measurement_says():
    pages = [ROOT / "README.md", ROOT / "docs" / "surface-truth.md"]
    said, measured = (re.findall(r"\d+ of \d+ rows", page.read_text(encoding="utf-8"))[:1] for page in pages)
    assert said == measured != []


def test_every_option_is_documented():
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    for name in COMMANDS:
        assert f"## {name}" in text
        for parameter in load(name).params:
            for option in [option for option in parameter.opts if option.startswith("--")]:
                assert f"`{option}" in text, f"{name} {option}"


@pytest.mark.parametrize("command", ["info", "edges", "surface", "segment", "convert"])
def test_every_key_of_the_json_is_documented(command, folder, capfd):
    names = {"edges": "edges.ply", "surface": "surface.step", "segment": "faces.ply", "convert": "part.step"}
    output = ["-o", names[command]] if command in names else []
    with pytest.raises(SystemExit) as stopped:
        main([command, "scan.xyz", "--json", "--unit", "mm", *output])
    assert stopped.value.code in (0, None)
    record = json.loads(capfd.readouterr().out)
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    missing = [key for key in record if f"`{key}`" not in text]
    nested = {key: value for key, value in record.items() if key in ("input", "scale", "edges", "boundary", "inside", "model")}
    nested |= {key: record[key][0] for key in ("faces", "edges", "relations") if isinstance(record.get(key), list) and record[key]}
    missing += [f"{key}.{part}" for key, value in nested.items() if isinstance(value, dict) for part in value if f"`{part}`" not in text]
    assert missing == []
