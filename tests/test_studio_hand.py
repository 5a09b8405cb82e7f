"""What hands do on the page, on one small part: keys, brush, lasso, sliders, forms, colours, files that are dropped."""

from __future__ import annotations

import pytest

import studio_server
from studio_person import Person
from studio_server import Studio

DROP = """
    const data = new DataTransfer();
    data.items.add(new File(["no scan"], "other.ply"));
    document.querySelector("header").dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
"""


@pytest.fixture(scope="module")
def person(browser, tmp_path_factory):
    """Before the faces of a part whose name a shell would read otherwise."""
    studio = Studio(studio_server.small_part(tmp_path_factory.mktemp("hand") / "it's [1].ply", step=0.6))
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 720})
        person = Person(context, studio.url)
        person.done("scan")
        person.wait("studio.viewer.cloud !== null")
        person.page.click("#step-faces")
        person.page.click("#compute")
        person.done("faces")
        yield person
        assert person.complaints == []
        context.close()
    finally:
        studio.stop()


def edits(person: Person) -> int:
    return person.page.evaluate("studio.store.state.edits.filter((edit) => edit.done).length")


def place(person: Person, x: float, y: float) -> tuple[float, float]:
    box = person.page.locator("main canvas").first.bounding_box()
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


def test_keys_do_nothing_behind_the_help(person):
    page = person.page
    page.click("#step-faces")
    page.click("button.face >> nth=0")
    page.keyboard.press("?")
    for key in ("Delete", "2", "PageDown"):
        page.keyboard.press(key)
    assert page.evaluate("[studio.store.step, studio.store.faces.length]") == ["faces", 1]
    page.keyboard.press("?")
    assert page.locator("dialog[open]").count() == 0
    page.wait_for_timeout(100)
    assert edits(person) == 0
    assert page.locator("#tool-turn").get_attribute("aria-pressed") == "true"
    page.keyboard.press("Escape")


def test_a_quick_stroke_of_the_brush_has_no_gaps(person):
    page = person.page
    page.keyboard.press("2")
    page.click("#through")

    def stroke(steps: int) -> int:
        page.mouse.move(*place(person, 0.3, 0.5))
        page.mouse.down()
        page.mouse.move(*place(person, 0.7, 0.5), steps=steps)
        page.mouse.up()
        n = page.evaluate("studio.selection.count")
        page.keyboard.press("Escape")
        assert page.evaluate("studio.selection.count") == 0
        return n

    quick, slow = stroke(1), stroke(40)
    assert quick > 20
    assert abs(quick - slow) <= 0.05 * slow
    page.click("#visible")
    page.keyboard.press("1")


def test_escape_gives_up_a_lasso(person):
    page = person.page
    before = person.lasso([(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)])
    page.mouse.move(*place(person, 0.4, 0.4))
    page.mouse.down()
    for corner in ((0.5, 0.4), (0.5, 0.5)):
        page.mouse.move(*place(person, *corner))
    page.keyboard.press("Escape")
    page.mouse.up()
    assert page.locator(".ink polygon").get_attribute("points") == ""
    assert page.evaluate("studio.selection.count") == before > 0
    page.keyboard.press("Escape")
    assert page.evaluate("studio.selection.count") == 0
    page.keyboard.press("1")


def test_the_threshold_is_dragged_in_the_histogram_and_set_back(person):
    page = person.page
    page.click("#step-edges")
    person.wait("studio.sync.strength !== null")
    n, found = edits(person), page.evaluate("studio.sync.threshold")
    assert not page.locator("#threshold-reset").is_visible()
    box = page.locator("canvas.histogram").bounding_box()
    page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 20, steps=3)
    assert page.locator(".threshold output").first.inner_text() == "45°"
    assert edits(person) == n
    page.mouse.up()
    person.wait(f"studio.store.state.edits.length === {n + 1} && studio.store.status('edges') === 'current'")
    assert page.evaluate("studio.store.status('faces')") == "current"  # of planes, whatever is marked
    page.click("#threshold-reset")
    person.wait(f"studio.store.state.edits.length === {n + 2} && studio.store.status('edges') === 'current'")
    person.wait(f"studio.sync.threshold === {found}")


def test_what_is_refused_does_not_stay(person):
    page = person.page
    page.click("#step-edges")
    found = page.evaluate("studio.sync.threshold")
    page.evaluate(
        "studio.sync.live(77, 0.4); studio.store.send({ type: 'Edit', edit: { set: { stage: 'edges', name: 'threshold', value: 91 } } })"
    )
    page.wait_for_selector(".toast:has-text('Threshold must be a number from 0 to 90.')")
    assert page.evaluate("studio.sync.threshold") == found
    assert float(page.input_value("#threshold")) == pytest.approx(found, abs=0.1)


def test_empty_fields_of_faces_do_nothing_or_say_why(person):
    page = person.page
    page.click("#step-faces")
    person.done("faces")
    page.click("button.face >> nth=0")
    n = edits(person)
    page.select_option("#face-kind", "")
    assert page.input_value("#face-kind") == "plane"
    page.fill("#face-tolerance", "0.4")
    page.keyboard.press("Enter")
    person.wait(f"studio.store.state.edits.length === {n + 1}")
    person.done("faces")
    page.fill("#face-tolerance", "")
    page.keyboard.press("Enter")
    page.wait_for_selector("#keeps-tolerance:has-text('undo the step')")
    assert page.input_value("#face-tolerance") == "0.4"
    assert edits(person) == n + 1
    page.keyboard.press("Escape")
    page.locator("main canvas").first.focus()
    page.keyboard.press("Control+z")
    person.wait("document.getElementById('keeps-tolerance') === null")
    assert page.locator(".toast:has-text('object')").count() == 0


def test_parameters_say_what_they_are(person):
    page = person.page
    page.click("#step-edges")
    page.locator("summary:has-text('More parameters')").click()
    field = page.locator(".field:has([id='field-edges.reach'])")
    assert not field.locator(".help").is_visible()
    field.locator(".info").click()
    assert field.locator(".help").is_visible()
    assert "h is the spacing" in page.locator(".lengths").first.inner_text()


def test_colours_are_kept_and_the_legend_says_what_is_seen(person):
    page = person.page
    page.click("#step-edges")
    page.select_option("#colouring", "height")
    page.click("#step-scan")
    page.click("#step-edges")
    assert page.evaluate("studio.sync.colouring") == "height"
    page.select_option("#colouring", "strength")
    page.evaluate("studio.store.send({ type: 'Edit', edit: { boundary: { add: { indices: [1, 2, 3, 4, 5, 6, 7, 8, 9] } } } })")
    page.wait_for_selector(".legend:has-text('added by hand')")
    page.click("#undo")
    page.wait_for_selector(".legend:not(:has-text('by hand'))")
    page.click("#step-faces")
    page.select_option("#colouring", "height")
    page.evaluate("studio.store.frames.get('cloud').header.numbers.z = 4512345; studio.sync.colour('height')")
    ticks = page.locator(".ticks span").all_inner_texts()
    assert len(set(ticks)) == 3
    assert all(tick.startswith("45123") for tick in ticks)
    page.uncheck("#layer-points")
    assert not page.locator(".legend").is_visible()  # nothing is coloured
    page.check("#layer-points")
    page.select_option("#colouring", "face")


def test_the_model_is_seen_in_the_colours_of_its_faces_and_taken_away_with_enter(person):
    page = person.page
    page.click("#step-model")
    page.select_option("#colouring", "height")
    page.keyboard.press("Enter") if page.evaluate("document.activeElement.matches('body')") else page.click("#compute")
    person.done("model")
    page.wait_for_selector(".legend:has-text('plane_0')")
    page.check("#layer-points")
    page.wait_for_selector(".legend:has-text('Height')")
    page.click("#step-export")
    assert not page.locator("#step-export.current").count()
    assert "--project '/" in page.locator("code:has-text('convert')").inner_text()
    assert "it'\\''s [1].ply.s2n'" in page.locator("code:has-text('convert')").inner_text()
    page.locator("main canvas").first.focus()
    page.keyboard.press("Enter")
    person.done("export")
    assert page.locator("a.download").inner_text() == "it's [1].step"


def test_a_file_that_is_dropped_beside_does_not_take_the_page_away(person):
    page = person.page
    page.evaluate(DROP)
    page.wait_for_selector(".toast:has-text('A scan is open already')")
    assert page.evaluate("studio.store.state.scan") == "it's [1].ply"
