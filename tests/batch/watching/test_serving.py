"""The page of a deck that is watched is served to who knows its address, on this machine, and to nobody else."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from batch.watching import door, serving
from batch.watching.board import KEPT, Board
from batch.watching.serving import PageServer
from met.diagnostic import Problem
from tests.batch.watching.watched import Answer, ask


@pytest.fixture
def server() -> Iterator[PageServer]:
    """A server whose board has a page and numbers."""
    board = Board("deck.ic")
    board.tell(names=["one", "two"], groups=["one.a", "one.b"])
    board.show("page", '{"count": 2}')
    board.show("numbers", '{"done": 3}')
    made = PageServer(board)
    made.begin()
    yield made
    made.end()


def get(server: PageServer, what: str, **words: str | None) -> Answer:
    return ask(server.server_port, f"/{server.token}/{what}", **words)


def test_what_there_is_is_served_and_may_be_nobody_elses(server: PageServer) -> None:
    frame, runs, page, numbers = (get(server, what) for what in ("", "run", "page/1", "numbers/1"))
    assert [each.status for each in (frame, runs, page, numbers)] == [200] * 4
    assert json.loads(page.body) == {"count": 2} and json.loads(numbers.body) == {"done": 3}
    assert [each.headers["Content-Type"] for each in (page, numbers)] == ["application/json"] * 2
    for answer in (frame, runs, page, numbers):
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert "Access-Control-Allow-Origin" not in answer.headers and "Python" not in str(answer.headers)
    policy = frame.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy
    assert runs.headers["Content-Security-Policy"] == "frame-ancestors 'self'"
    of_runs = runs.body.decode().partition('http-equiv="Content-Security-Policy" content="')[2].partition('"')[0]
    assert "default-src 'none'" in of_runs and "connect-src" not in of_runs and "unsafe-inline" not in of_runs
    for data in (page, numbers):
        assert data.headers["Content-Security-Policy"] == "default-src 'none'; frame-ancestors 'none'"
    assert get(server, "", Host=f"localhost:{server.server_port}").status == 200


def test_who_does_not_know_the_token_is_told_nothing(server: PageServer) -> None:
    other = server.token[:-1] + ("A" if server.token[-1] != "A" else "B")
    paths = ["/", "/page/1", f"/{other}/", f"/{server.token[:-1]}/", f"/{server.token}x/", f"/{server.token}", "//"]
    paths += ["*", f"/{other}/page/1", f"/x/{server.token}/", f"http://127.0.0.1/{server.token}/"]
    paths += ["/?" + server.token]
    for path in paths:
        answer = ask(server.server_port, path)
        assert (answer.status, answer.body) == (404, b""), path
    assert len(server.token) == 32


@pytest.mark.parametrize(
    "what",
    ["../../etc/passwd", "page/../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "page/1/../..", "page/-1",
     "page/99", "page/1e0", "page/٣", "page/" + "9" * 5000, "deck.ic", "assets/frame.js", "page//etc/passwd",
     "numbers/2", "choose", "[", "page/[1"],
)  # fmt: skip
def test_nothing_of_the_disk_can_be_asked_for(server: PageServer, what: str) -> None:
    path = f"/{server.token}/{what}".encode().decode("latin-1")
    connection = socket.create_connection(("127.0.0.1", server.server_port))
    with connection, connection.makefile("rb") as answer:
        request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\n\r\n"
        connection.sendall(request.encode("latin-1"))
        assert answer.readline().split()[1] == b"404"
        assert answer.read().partition(b"\r\n\r\n")[2] == b""


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost", "[::1]:{port}", "", None])
def test_who_comes_by_another_name_is_refused(server: PageServer, host: str | None) -> None:
    named = None if host is None else host.format(port=server.server_port)
    answer = get(server, "page/1", Host=named)
    assert (answer.status, answer.body) == (421, b"")


@pytest.mark.parametrize("address", ["http://[", "//[", "http://[::1", "/[", "?", "#", "%", "a:[/b"])
def test_an_address_that_is_none_is_refused_without_a_word(
    server: PageServer, address: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with socket.create_connection(("127.0.0.1", server.server_port), 20) as connection:
        host = f"Host: 127.0.0.1:{server.server_port}\r\n"
        connection.sendall(f"GET {address} HTTP/1.1\r\n{host}\r\n".encode())
        assert connection.recv(100).split()[1] == b"404"
        while connection.recv(1000):
            pass
    assert capfd.readouterr() == ("", "")


def test_two_names_are_refused(server: PageServer) -> None:
    with socket.create_connection(("127.0.0.1", server.server_port)) as connection:
        host = f"Host: 127.0.0.1:{server.server_port}\r\n"
        connection.sendall(f"GET /{server.token}/ HTTP/1.1\r\n{host}Host: evil.example\r\n\r\n".encode())
        assert connection.recv(100).split()[1] == b"421"


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://localhost:{port}", "http://127.0.0.1:1"],
)
def test_what_another_page_sends_is_refused(server: PageServer, origin: str) -> None:
    named = origin.format(port=server.server_port)
    for what in ("", "run", "page/1", "numbers/1", "events"):
        assert get(server, what, Origin=named).status == 403
    assert get(server, "choose", method="POST", body="run=two", Origin=named).status == 403
    assert not server.board.is_chosen()


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_a_browser_says_another_page_has_asked_for_is_refused(server: PageServer, site: str) -> None:
    assert get(server, "page/1", Sec_Fetch_Site=site).status == 403
    assert get(server, "page/1", Sec_Fetch_Site="same-origin").status == 200


def test_a_choice_is_of_what_there_is_and_of_the_page_itself(server: PageServer) -> None:
    own = f"http://127.0.0.1:{server.server_port}"

    def choose(body: str, **words: str | None) -> int:
        return get(server, "choose", method="POST", body=body, **{"Origin": own, **words}).status

    assert choose("run=two", Origin=None) == 403
    for wrong in ("run=three", "group=one.a", "", "run=one&group=two.b", "run=%ff"):
        assert choose(wrong) == 400
    for length in ("-1", "99999999999", "9" * 5000, "x", None):
        assert choose("run=two", Content_Length=length) == 400
    assert not server.board.is_chosen()
    assert choose("run=one&group=one.b") == 200
    assert server.board.take_chosen() == ("one", "one.b") and server.board.take_chosen() is None
    assert get(server, "page/1", method="POST", body="run=two", Origin=own).status == 404


def test_other_methods_are_refused(server: PageServer) -> None:
    for method in ("HEAD", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"):
        answer = get(server, "page/1", method=method)
        assert (answer.status, answer.body) == (501, b"")


def test_it_listens_on_this_machines_own_address_alone(server: PageServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", server.server_port), 5).close()


def test_who_has_not_shown_the_token_takes_no_place(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strangers who say nothing, or begin a request, wait outside: some are turned away, and all are soon."""
    many = [socket.create_connection(("127.0.0.1", server.server_port), 20) for _ in range(door.MOST_OUTSIDE + 8)]
    for n, said in enumerate((b"GET /", b"POST", f"GET /{server.token}".encode())):
        many[-1 - n].sendall(said)
    assert [get(server, "page/1").status for _ in range(20)] == [200] * 20
    assert [each.recv(1) for each in many[:8]] == [b""] * 8  # the first to come are the first to go
    monkeypatch.setattr(door, "OUTSIDE_SECONDS", 0.0)
    assert [each.recv(1) for each in many[8:]] == [b""] * door.MOST_OUTSIDE
    for each in many:
        each.close()


def test_who_has_the_token_and_takes_all_places_is_told_to_come_again(
    server: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving._Request, "timeout", 6.0)  # long enough for all to come on a busy machine
    monkeypatch.setattr(door, "OUTSIDE_SECONDS", 20.0)
    with ExitStack() as stack:
        many = [
            stack.enter_context(socket.create_connection(("127.0.0.1", server.server_port), 20))
            for _ in range(serving.MOST_OPEN + 1)
        ]
        for each in many:
            each.sendall(f"GET /{server.token}/page/1 HTTP/1.1\r\n".encode())  # and then nothing
        with many[-1].makefile("rb") as answer:
            assert answer.read() == serving.FULL
        assert many[0].recv(1) == b""  # it says nothing more, and is given up


def test_a_request_that_comes_byte_by_byte_is_let_in(server: PageServer) -> None:
    with socket.create_connection(("127.0.0.1", server.server_port), 20) as slow:
        slow.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in f"GET /{server.token}/page/1 HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\n\r\n".encode():
            slow.sendall(bytes([byte]))
        assert slow.recv(100).split()[1] == b"200"


@pytest.mark.parametrize("posted", [False, True])
def test_who_sends_a_byte_now_and_then_is_given_up(
    server: PageServer, monkeypatch: pytest.MonkeyPatch, posted: bool
) -> None:
    monkeypatch.setattr(serving._Request, "timeout", 1.0)
    monkeypatch.setattr(door, "OUTSIDE_SECONDS", 1.0)
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", server.server_port), 0.1) as slow:
        if posted:
            own = f"127.0.0.1:{server.server_port}"
            head = f"POST /{server.token}/choose HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\n"
            slow.sendall(f"{head}Content-Length: 9000\r\n\r\n".encode())
        while True:
            try:
                slow.sendall(b"r")
                if slow.recv(1) == b"":
                    break
            except TimeoutError:  # it waits for more
                assert time.monotonic() - began < 20
            except OSError:
                break
    assert not posted or time.monotonic() - began >= 0.9
    assert get(server, "page/1").status == 200


def test_a_page_hears_what_is_now_and_then_what_changes(server: PageServer) -> None:
    connection = socket.create_connection(("127.0.0.1", server.server_port), 20)
    with connection, connection.makefile("rb") as told:
        request = f"GET /{server.token}/events HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\n\r\n"
        connection.sendall(request.encode())
        while told.readline().strip():
            pass
        state = json.loads(told.readline().removeprefix(b"data: "))
        assert (state["name"], state["page"], state["numbers"]) == ("deck.ic", 1, 1)
        assert told.readline() == b"\n"
        threading.Timer(0.05, lambda: server.board.show("page", '{"count": 3}', numbers=0)).start()
        state = json.loads(told.readline().removeprefix(b"data: "))
        assert (state["page"], state["numbers"]) == (2, 0)


def test_what_is_told_of_a_page_that_is_no_longer_shown_counts_no_more() -> None:
    board = Board("deck.ic")
    first = board.show("page", "first")
    board.tell(first, doing="1 of 2 cases are run")
    assert board.after(0, 0.0)[1]["doing"] == "1 of 2 cases are run"  # type: ignore[index]
    second = board.show("page", "second", numbers=0, doing="")
    board.show("numbers", "of the first", first, doing="late")
    assert board.after(0, 0.0)[1]["numbers"] == 0  # type: ignore[index]
    assert board.after(0, 0.0)[1]["doing"] == ""  # type: ignore[index]
    board.show("numbers", "of the second", second)
    assert board.text("numbers", board.after(0, 0.0)[1]["numbers"]) == b"of the second"  # type: ignore[index]
    for n in range(10):
        board.show("page", str(n))
    assert [board.text("page", n) is not None for n in range(1, 13)] == [False] * (12 - KEPT) + [True] * KEPT


def test_a_port_that_is_taken_is_told(server: PageServer) -> None:
    with pytest.raises(Problem) as caught:
        PageServer(Board("deck.ic"), server.server_port)
    assert [each.message for each in caught.value.diagnostics] == [
        f"cannot serve on port {server.server_port} of 127.0.0.1: address already in use"
    ]


def test_the_frame_is_the_same_for_each_deck_and_holds_no_text_of_one() -> None:
    text, policy = serving.frame()
    assert "deck.ic" not in text and text.count("<script>") == 1 and "innerHTML" not in text
    assert Path(serving.__file__).with_name("assets").joinpath("frame.js").read_text().strip() in text
    assert policy.count("sha256-") == 2
