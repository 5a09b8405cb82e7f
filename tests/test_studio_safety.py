"""Who may talk to the studio: for each rule the bad request, sent to a real server."""

from __future__ import annotations

import json
import os
import signal
import socket
from urllib.parse import quote

import pytest

pytest.importorskip("starlette", reason="the studio is an extra")
pytest.importorskip("uvicorn", reason="the studio is an extra")
refusals = pytest.importorskip("websockets.exceptions", reason="the studio is an extra")

import studio_server  # noqa: E402
from scan2nurbs.studio.launch import is_local  # noqa: E402
from studio_server import Studio, hear, is_current, say  # noqa: E402


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    scan = studio_server.small_part(tmp_path_factory.mktemp("safe") / "step.ply", step=0.8)
    running = Studio(scan)
    running.folder = scan.parent
    yield running
    assert running.stop() in (130, -2)


def test_the_page_itself_is_open_and_carries_its_policy(studio):
    for path in ("/", "/assets/studio.js", "/favicon.svg"):
        status, headers, body = studio.ask("GET", path)
        assert status == 200
        assert len(body) > 100
        assert headers["x-content-type-options"] == "nosniff"
        assert "default-src 'self'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]


def test_the_token_becomes_a_cookie_that_scripts_cannot_read(studio):
    status, headers, _ = studio.ask("POST", "/session", studio.token, Origin=studio.origin)
    assert status == 200
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]
    assert studio.token not in headers["set-cookie"]


@pytest.mark.parametrize("token", ["", "x", "Ω" * 30, "a" * 5000])
def test_a_wrong_token_is_refused(studio, token):
    status, headers, _ = studio.ask("POST", "/session", token, Origin=studio.origin)
    assert status == 403
    assert "set-cookie" not in headers


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:{port}", ""])
def test_a_foreign_host_is_refused(studio, host):
    host = host.format(port=studio.port)
    assert studio.ask("GET", "/", Host=host)[0] in (400, 403)
    assert studio.ask("POST", "/session", studio.token, Host=host, Origin=studio.origin)[0] in (400, 403)


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example", "https://127.0.0.1:{port}", "http://127.0.0.1"])
def test_a_write_from_a_foreign_origin_is_refused(studio, origin):
    said = {} if origin is None else {"Origin": origin.format(port=studio.port)}
    assert studio.ask("POST", "/session", studio.token, **said)[0] == 403
    assert studio.ask("POST", "/scan?name=x.ply", b"", Cookie=studio.cookie(), **said)[0] == 403


@pytest.mark.parametrize(
    "wrong",
    [
        {"origin": "http://evil.example"},
        {"origin": None},
        {"additional_headers": {}},
        {"additional_headers": {"Cookie": "scan2nurbs=guess"}},
    ],
)
def test_a_foreign_websocket_is_refused(studio, wrong):
    with pytest.raises(refusals.InvalidStatus) as refused, studio.page(**wrong):
        pass
    assert refused.value.response.status_code == 403


def test_a_websocket_to_a_foreign_host_is_refused(studio):
    from websockets.sync.client import connect

    said = {"origin": studio.origin, "additional_headers": {"Cookie": studio.cookie()}}
    foreign = f"ws://evil.example:{studio.port}/ws"
    sock = socket.create_connection(("127.0.0.1", studio.port))
    with sock, pytest.raises(refusals.InvalidStatus), connect(foreign, sock=sock, **said):
        pass


def test_files_are_those_that_were_exported_and_no_others(studio):
    cookie = studio.cookie()
    outside = studio.folder / "secret.txt"
    outside.write_text("secret")
    exports = studio.folder / "step.ply.s2n" / "exports"
    exports.mkdir(exist_ok=True)
    (exports / "stranger.step").write_text("secret")
    os.symlink(outside, exports / "link.step")
    for name in (
        "../project.json",
        "..%2fproject.json",
        "%2e%2e/%2e%2e/secret.txt",
        "..%2f..%2fsecret.txt",
        "/etc/passwd",
        "stranger.step",
        "link.step",
        "%00",
    ):
        status, _, body = studio.ask("GET", f"/files/{name}", Cookie=cookie)
        assert status in (400, 404), name
        assert b"secret" not in body
        assert studio.ask("GET", f"/files/{name}")[0] in (400, 403, 404)
    for path in ("/assets/../index.html", "/assets/..%2f..%2fserver.py", "/assets/%2e%2e/%2e%2e/server.py", "//etc/passwd"):
        status, _, body = studio.ask("GET", path)
        assert status in (400, 403, 404), path
        assert b"import" not in body


def test_a_second_scan_or_a_bad_name_is_refused(studio):
    said = {"Cookie": studio.cookie(), "Origin": studio.origin}
    assert studio.ask("POST", "/scan?name=other.ply", b"ply", **said)[0] == 409


def test_messages_have_a_limit_and_nonsense_does_no_harm(studio):
    with studio.page() as page:
        hear(page, "State", is_current("scan"))
        for text in (
            "{",
            '{"type": "Nothing"}',
            '{"type": "Edit", "edit": {"face": {"explode": 1}}}',
            '{"type": "Export", "kind": "../x"}',
        ):
            page.send(text)
            assert hear(page, "Trouble", seconds=5)["text"].endswith(".")
        say(page, "Compute", until="edges")
        state = hear(page, "State", is_current("edges"))
        assert state["edits"] == []

    def listen(page):
        page.send(json.dumps({"type": "Edit", "edit": {"x": "y" * (33 << 20)}}))
        while True:
            page.recv(timeout=20)

    with studio.page() as page, pytest.raises(refusals.ConnectionClosedError) as closed:
        listen(page)
    # The server hangs up while the page still sends: the reset may overtake the reason.
    assert closed.value.rcvd is None or closed.value.rcvd.code == 1009
    with studio.page() as page:
        assert hear(page, "State", is_current("edges"))["edits"] == []


def test_only_this_machine_is_let_in_unless_told():
    assert is_local("127.0.0.1")
    assert is_local("localhost")
    assert not is_local("0.0.0.0")
    assert not is_local("192.168.1.7")
    assert not is_local("example.com")


def test_another_address_is_warned_of_and_answers_to_this_machines_names(monkeypatch, capsys):
    from scan2nurbs.cli.main import main
    from scan2nurbs.studio import launch

    served = []
    monkeypatch.setattr(launch, "serve", lambda *_, **options: served.append(options["host"]))
    with pytest.raises(SystemExit):
        main(["studio", "--host", "0.0.0.0", "--no-open"])
    assert served == ["0.0.0.0"]
    assert "warning: the studio listens on 0.0.0.0" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["studio", "--no-open"])
    assert served[1:] == ["127.0.0.1"]
    assert capsys.readouterr().err == ""
    assert socket.gethostname() in launch._names("0.0.0.0")
    assert launch._names("192.168.1.7") == ["192.168.1.7"]


@pytest.mark.parametrize(
    ("host", "shown"), [("127.0.0.1", "127.0.0.1"), ("127.0.0.2", "127.0.0.2"), ("localhost", "127.0.0.1"), ("::1", "[::1]")]
)
def test_the_address_that_is_printed_is_the_one_that_is_listened_on(monkeypatch, tmp_path, host, shown):
    from scan2nurbs.studio import launch

    def answers(server, sockets):
        (listening,) = sockets
        with socket.create_connection(listening.getsockname()[:2], timeout=5):
            assert f"{shown}:{listening.getsockname()[1]}" in server.config.app.access.hosts
        listening.close()

    if host == "::1" and not socket.has_ipv6:
        pytest.skip("this machine has no IPv6")
    monkeypatch.setattr(launch.uvicorn.Server, "run", answers)
    said: list[str] = []
    launch.serve(None, host=host, port=0, home=tmp_path, opens=False, say=said.append)
    assert said[0].startswith(f"http://{shown}:")


@pytest.mark.skipif(os.name == "nt", reason="there are no process groups")
def test_ctrl_c_in_a_terminal_ends_it_quietly(tmp_path):
    """It reaches all processes of the group, and impatient people press it twice."""
    studio = Studio(cwd=tmp_path, start_new_session=True)
    with studio.process:
        studio.ask("GET", "/")
        for _ in range(2):
            os.killpg(studio.process.pid, signal.SIGINT)
        assert studio.process.wait(20) in (130, -2)
        assert studio.process.stderr is not None
        assert studio.process.stderr.read() == "scan2nurbs: Interrupted; no file was left half-written.\n"


def test_a_scan_can_be_dropped_on_an_empty_studio(tmp_path):
    scan = studio_server.small_part(tmp_path / "step.ply", step=1.2)
    home = tmp_path / "home"
    home.mkdir()
    studio = Studio(cwd=home)
    try:
        said = {"Cookie": studio.cookie(), "Origin": studio.origin}
        for name in ("", "../x.ply", "a/b.ply", ".hidden", "x" * 300, "-x.ply", "a%5Cb.ply", "a%0Ab.ply", "a%00.ply", "%E2%80%AEb.ply"):
            assert studio.ask("POST", f"/scan?name={name}", b"ply", **said)[0] == 400
        assert list(home.iterdir()) == []
        mine = "part [1], #2 & 5% @ l=3 'new'.ply"
        assert studio.ask("POST", f"/scan?name={quote(mine)}", scan.read_bytes(), **said)[0] == 200
        with studio.page() as page:
            assert hear(page, "State", is_current("scan"))["scan"] == mine
        assert (home / f"{mine}.s2n" / "project.json").exists()
    finally:
        studio.stop()
