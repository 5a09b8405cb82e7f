"""What the page looks like, on one page before a model: texts that can be read, controls in their places, a net that is seen."""

from __future__ import annotations

import pytest

import studio_server
from studio_looks import drawn_contrasts, faint_texts, misplaced
from studio_person import Person
from studio_server import Studio

WIDTHS = (1280, 1024)


@pytest.fixture(scope="module")
def person(browser, tmp_path_factory):
    """Before the model of a small part, with a tool and the perspective camera; `while_computing` has what was wrong on the way."""
    studio = Studio(studio_server.small_part(tmp_path_factory.mktemp("looks") / "step.ply", step=0.5))
    try:
        context = browser.new_context(viewport={"width": WIDTHS[0], "height": 720})
        person = Person(context, studio.url)
        page = person.page
        person.done("scan")
        person.wait("studio.viewer.cloud !== null")
        page.click("#tool-lasso")
        page.keyboard.press("p")
        page.click("#step-model")
        page.click("#compute")
        page.wait_for_selector("#cancel")
        person.while_computing = wrong(person)
        person.done("model")
        yield person
        context.close()
    finally:
        studio.stop()


@pytest.fixture(autouse=True)
def no_complaints(person):
    yield
    assert person.complaints == []


def wrong(person: Person) -> list[str]:
    """Return which texts are too faint, and which controls are not in their places in windows of either width."""
    found = faint_texts(person.page)
    for width in WIDTHS:
        person.page.set_viewport_size({"width": width, "height": 720})
        person.settle()
        found += [f"{width}: {fault}" for fault in misplaced(person.page)]
    return found


def test_the_page_can_be_read_and_used_while_it_computes(person):
    assert person.while_computing == []


@pytest.mark.parametrize("step", ["scan", "edges", "faces", "surfaces", "model", "export"])
def test_every_step_can_be_read_and_used(person, step):
    """Every text with enough contrast, every control in its place."""
    page = person.page
    page.click(f"#step-{step}")
    for summary in page.locator("details:not([open]) summary").all():
        summary.click()
    for colour in page.locator("#colouring option:not([disabled])").all():
        page.select_option("#colouring", colour.get_attribute("value"))
        assert faint_texts(page, ".stage") == []
    assert wrong(person) == []


def test_the_histogram_can_be_read(person):
    """Bars, threshold and numbers are drawn, so that no style says their colours."""
    page = person.page
    page.click("#step-edges")
    least = drawn_contrasts(page, "canvas.histogram", 13)
    assert 3.0 <= least["marks"] < 21.0
    assert 4.5 <= least["texts"] < 21.0
    page.evaluate("Object.assign(document.querySelector('.histogram').getContext('2d'), { fillStyle: '#2a3542' }).fillRect(0, 0, 9, 99)")
    least = drawn_contrasts(page, "canvas.histogram", 13)
    assert max(least.values()) < 2.0  # what is wrong would be found


def test_troubles_can_be_read(person):
    page = person.page
    page.click("#step-faces")
    page.click("button.face >> nth=0")
    page.fill("[id='field-segment.max_faces']", "-5")
    page.keyboard.press("Enter")
    page.wait_for_selector(".toast")
    assert faint_texts(page) == []
    page.evaluate("studio.store.send({ type: 'Edit', edit: { face: { merge: [0, 777] } } })")
    page.wait_for_selector(".trouble")
    assert faint_texts(page) == []
    page.click("#undo")
    person.done("faces")
    assert faint_texts(page) == []  # the list has what was undone
    page.click("#help")
    assert faint_texts(page, "dialog") == []
    page.keyboard.press("Escape")


def test_the_control_net_of_a_face_is_seen_over_it(person):
    page = person.page
    page.click("#step-faces")
    page.click("button.face >> nth=0")
    page.select_option("#face-kind", label="bspline (NURBS)")
    page.wait_for_selector("button.face:has-text('bspline_0')", timeout=60_000)
    person.done("faces")
    page.wait_for_selector("p:has-text('control points')")
    page.click("#step-surfaces")
    page.click("#compute")
    person.done("surfaces")
    before = person.picture()
    page.check("#layer-nets")
    net = person.picture() - before
    green = (net[..., 1] > 0.2) & (net[..., 1] > net[..., 0] + 0.1)
    assert green.sum() > 100
    assert green.any(axis=0).sum() > 50  # no dot: a net
    page.uncheck("#layer-nets")


def test_what_is_wrong_would_be_found(person):
    page = person.page
    page.evaluate("Object.assign(document.getElementById('fit').style, { color: '#555', position: 'fixed', left: '-20px' })")
    assert "button#fit" in faint_texts(page)[0]
    assert "button#fit" in misplaced(page)[0]
    page.evaluate("document.getElementById('fit').removeAttribute('style')")
