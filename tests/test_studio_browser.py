"""The studio as a person uses it, in a real browser: from a scan to a STEP file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import studio_server
from scan2nurbs.cli.main import main
from studio_looks import faint_texts
from studio_person import Person
from studio_server import Studio


@pytest.fixture
def studio(tmp_path):
    running = Studio(studio_server.small_part(tmp_path / "step.ply", step=0.45))
    yield running
    running.stop()


STAYS = "(() => { const old = document.getElementById('cancel'); studio.store.tell('progress'); return old.isConnected; })()"
RELATIONS_MADE = "Number(studio.store.result('surfaces').figures.find((figure) => figure.label.startsWith('Relations')).value)"


def n_edits(n: int, done: int) -> str:
    return f"studio.store.state.edits.length === {n} && studio.store.state.edits.filter((edit) => edit.done).length === {done}"


def test_from_a_scan_to_a_step_file(browser, studio, tmp_path):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    person = Person(context, studio.url)
    person.done("scan")
    person.wait("studio.viewer.cloud !== null")
    assert "token" not in person.page.url
    scan_picture = person.picture()
    assert scan_picture.std() > 0.05  # a blank canvas has none

    person.go_on("edges")
    move_the_threshold(person)
    correct_edges(person)
    person.page.reload()
    person.done("edges")
    person.wait(n_edits(2, 2))
    person.page.wait_for_selector("text=taken away", timeout=30_000)
    person.wait("studio.viewer.cloud !== null")

    person.go_on("faces")
    other = Person(context, studio.origin)  # a second tab
    other.done("faces")
    person.page.bring_to_front()  # a tab behind another one draws once a second
    split_a_face(person, other)
    give_a_tolerance(person)
    delete_faces_and_undo_once(person)

    person.go_on("surfaces")
    choose_relations(person)
    person.go_on("model")
    model_picture = person.picture()
    assert model_picture.std() > 0.05
    assert np.abs(model_picture - scan_picture).mean() > 0.01
    exported = take_away(person, tmp_path / "exported.step")
    assert person.complaints == other.complaints == []
    context.close()

    from scan2nurbs.brep.check import check
    from scan2nurbs.brep.read import read_shape

    assert check(read_shape(exported)).valid
    again = tmp_path / "replayed" / "step.step"
    again.parent.mkdir()
    with pytest.raises(SystemExit) as ended:
        main(["convert", "--project", str(tmp_path / "step.ply.s2n"), "-o", str(again), "--quiet"])
    assert not ended.value.code
    assert again.read_bytes() == exported.read_bytes()


def move_the_threshold(person: Person) -> None:
    page, before = person.page, person.picture()
    assert person.n_colours() > 20
    page.evaluate("const s = document.getElementById('threshold'); s.value = '89'; s.dispatchEvent(new Event('input'))")
    assert page.evaluate("studio.store.state.edits.length") == 0  # nothing is sent while the slider moves
    page.wait_for_timeout(400)
    assert np.abs(person.picture() - before).mean() > 0.003
    page.evaluate("const s = document.getElementById('threshold'); s.value = '20'; s.dispatchEvent(new Event('change'))")
    person.wait(n_edits(1, 1))
    person.done("edges")


def see_what_matters(person: Person) -> None:
    """The form has the parameters of the operator that is chosen, and no others."""
    page = person.page
    page.click("#step-edges")
    page.locator("summary:has-text('More parameters')").click()
    shown = {name: page.locator(f"[id='field-edges.{name}']") for name in ("alpha", "small_radius", "reach", "operator")}
    assert {name: field.count() for name, field in shown.items()} == {"alpha": 0, "small_radius": 0, "reach": 1, "operator": 1}
    page.select_option("[id='field-edges.operator']", "edn")
    shown["alpha"].wait_for()
    assert {name: field.count() for name, field in shown.items()} == {"alpha": 1, "small_radius": 1, "reach": 0, "operator": 1}
    page.click("#undo")
    shown["reach"].wait_for()
    assert shown["alpha"].count() == 0


def correct_edges(person: Person) -> None:
    page, whole = person.page, [(0.2, 0.2), (0.8, 0.2), (0.8, 0.85), (0.2, 0.85)]
    visible = person.lasso(whole)
    page.click("#through")
    assert 100 < visible < 0.8 * person.lasso(whole)
    page.click("#visible")
    assert 10 < person.lasso([(0.35, 0.3), (0.5, 0.3), (0.5, 0.8), (0.35, 0.8)]) < visible
    page.click("#boundary-drop")
    person.wait(n_edits(2, 2))
    page.wait_for_selector("text=taken away", timeout=30_000)
    page.keyboard.press("Control+z")
    person.wait(n_edits(2, 1))
    page.wait_for_selector("text=taken away", state="detached", timeout=30_000)
    page.click("#redo")
    person.wait(n_edits(2, 2))
    page.wait_for_selector("text=taken away", timeout=30_000)


def split_a_face(person: Person, other: Person) -> None:
    page = person.page
    n_faces = page.evaluate("studio.store.entries().length")
    page.keyboard.press("t")
    page.click("#tool-turn")
    box = page.locator("main canvas").first.bounding_box()
    page.mouse.click(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
    person.wait("studio.store.faces.length === 1")  # picked in the picture
    assert person.lasso([(0.3, 0.2), (0.45, 0.2), (0.45, 0.9), (0.3, 0.9)]) > 50
    page.click("#face-split")
    person.wait(f"studio.store.entries().length === {n_faces + 1} && studio.store.status('faces') === 'current'")
    other.wait(f"studio.store.entries().length === {n_faces + 1}")


def give_a_tolerance(person: Person) -> None:
    page = person.page
    assert page.locator("#face-tolerance").is_enabled()  # a face is chosen
    page.fill("#face-tolerance", "-1")
    page.keyboard.press("Enter")
    assert page.input_value("#face-tolerance") == ""  # what is none goes away
    n = page.evaluate("studio.store.state.edits.length")
    page.fill("#face-tolerance", "0.4")
    page.keyboard.press("Enter")
    person.wait(n_edits(n + 1, n + 1))
    person.done("faces")
    assert page.input_value("#face-tolerance") == "0.4"
    page.wait_for_selector("p:has-text('tolerance 0.4 mm')")


def delete_faces_and_undo_once(person: Person) -> None:
    page = person.page
    n, n_faces = page.evaluate("[studio.store.state.edits.length, studio.store.entries().length]")
    page.click("button.face >> nth=1")
    page.click("button.face >> nth=2", modifiers=["Shift"])
    page.keyboard.press("Delete")
    person.wait(n_edits(n + 1, n + 1))
    person.wait(f"studio.store.entries().length === {n_faces - 2} && studio.store.status('faces') === 'current'")
    page.keyboard.press("Control+z")
    person.wait(n_edits(n + 1, n))
    person.wait(f"studio.store.entries().length === {n_faces} && studio.store.status('faces') === 'current'")


def choose_relations(person: Person) -> None:
    page = person.page
    n = page.evaluate("studio.store.state.edits.filter((edit) => edit.done).length")  # what is done next takes the place of what was undone
    made = page.evaluate(RELATIONS_MADE)
    page.click("summary:has-text('More parameters')")
    page.uncheck("label:has-text('perpendicular') input")
    person.wait(n_edits(n + 1, n + 1))
    person.done("surfaces")
    assert 0 < page.evaluate(RELATIONS_MADE) < made
    page.fill("[id='field-relations.angle']", "0.2")
    page.keyboard.press("Enter")
    person.wait(n_edits(n + 2, n + 2))
    person.done("surfaces")


def test_a_person_who_begins_with_nothing_is_led(browser, tmp_path):
    """A file that is no scan, a scan, a change that cannot be done, a stop, a second tab, a studio that is started again."""
    scan = studio_server.small_part(tmp_path / "step.ply", step=0.45)
    (tmp_path / "bad.ply").write_text("no scan\n" * 30)
    (home := tmp_path / "home").mkdir()
    studio = Studio(cwd=home)
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 720})
        person = Person(context, studio.url)
        page = person.page
        page.wait_for_selector("text=There is no scan yet")
        page.set_input_files("#scan-file", str(tmp_path / "bad.ply"))
        page.wait_for_selector("text=Choose another file.", timeout=60_000)
        page.set_input_files("#scan-file", str(scan))
        person.done("scan")
        person.wait("studio.viewer.cloud !== null && studio.sync.colouring === 'height'")
        assert person.n_colours() > 50  # its shape is seen
        assert page.locator(".legend").is_visible()
        person.go_on("edges")
        person.go_on("faces")
        trouble_is_told_where_it_is_seen(person)
        person.go_on("surfaces")
        second = Person(context, studio.origin)
        second.done("surfaces")
        second.page.wait_for_selector("button.face >> nth=0")  # its arrays came after the state
        assert person.complaints == second.complaints == []
        context.close()
    finally:
        studio.kill()

    studio = Studio(home / "step.ply.s2n")
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 720})
        person = Person(context, studio.url)
        person.done("surfaces")
        person.wait("studio.store.step === 'surfaces'")  # where it was left
        person.page.wait_for_selector("button.face >> nth=0")
        assert person.complaints == []
        context.close()
    finally:
        studio.stop()


def trouble_is_told_where_it_is_seen(person: Person) -> None:
    page = person.page
    page.evaluate("studio.store.send({ type: 'Edit', edit: { face: { merge: [0, 777] } } })")
    page.wait_for_selector(".trouble:has-text('no face 777')")
    assert page.locator(".trouble").bounding_box()["y"] < 400  # above forms and lists
    page.click("#step-model")
    page.wait_for_selector(".trouble:has-text('Faces: ')")
    page.click("button:has-text('Go to Faces')")
    page.click("button:has-text('Undo the last change')")
    page.wait_for_selector(".trouble", state="detached")
    person.done("faces")


def test_stopping_says_so_and_a_refused_value_goes_away(browser, studio):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    person = Person(context, studio.url)
    page = person.page
    person.done("scan")
    page.click("#step-model")
    page.click("#compute")
    page.wait_for_selector("#cancel")
    assert page.evaluate(STAYS)  # what is replaced while it is pressed is not clicked
    page.click("#cancel")
    page.wait_for_selector("text=Stopped. What was done before is kept.")
    page.wait_for_selector("#compute:enabled")
    assert page.evaluate("studio.store.state.running === null && !studio.store.stopping")
    page.click("#step-faces")
    page.fill("[id='field-segment.max_faces']", "-5")
    page.keyboard.press("Enter")
    page.wait_for_selector(".toast:has-text('Max faces must be a whole number')")
    assert page.input_value("[id='field-segment.max_faces']") == ""
    see_what_matters(person)
    assert person.complaints == []
    context.close()


def take_away(person: Person, path: Path) -> Path:
    page = person.page
    page.click("#next")
    page.click("#export-step")
    page.wait_for_selector("a.download", timeout=60_000)
    with page.expect_download() as download:
        page.click("a.download")
    download.value.save_as(path)
    return path


def test_what_a_person_is_told_when_the_studio_is_gone(browser, tmp_path):
    studio = Studio(cwd=tmp_path)
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    person = Person(context, studio.url)
    person.page.wait_for_selector("text=Drop the file of a scan here")
    person.page.keyboard.press("?")
    person.page.wait_for_selector("text=Keyboard and mouse")
    person.page.keyboard.press("Escape")
    studio.kill()
    person.page.wait_for_selector("text=The studio is not running", timeout=20_000)
    assert faint_texts(person.page) == []
    context.close()
