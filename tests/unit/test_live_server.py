"""The live page's server: who is let in, what is sent, and that readers who come and go leave nothing behind."""

import http.client
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from lidarspectra.errors import DeviceError
from lidarspectra.workflow.live.board import Board
from lidarspectra.workflow.live.server import COOKIE, LiveServer

PATIENCE_S = 30.0


@contextmanager
def serving(host: str = "127.0.0.1") -> Iterator[tuple[LiveServer, Board]]:
    board = Board()
    server = LiveServer("<p>the page</p>", board, lambda: '{"times":[]}', host=host)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server, board
    finally:
        board.close()
        server.shutdown()
        server.server_close()
        thread.join(PATIENCE_S)


def ask(server: LiveServer, path: str = "/", *, method: str = "GET", **headers: str) -> tuple[int, str, dict[str, str]]:
    link = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=PATIENCE_S)
    try:
        link.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = link.getresponse()
        return answer.status, answer.read().decode(), dict(answer.getheaders())
    finally:
        link.close()


@contextmanager
def listening(server: LiveServer) -> Iterator[http.client.HTTPResponse]:
    link = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=PATIENCE_S)
    link.request("GET", "/events")
    answer = link.getresponse()
    try:
        yield answer
    finally:
        answer.close()
        link.close()


def next_message(answer: http.client.HTTPResponse) -> str:
    while True:
        line = answer.readline().decode()
        assert line, "the stream ended"
        if line.startswith("data: "):
            return line.removeprefix("data: ").strip()


def test_the_page_and_its_numbers_are_served_to_this_machine_without_a_token() -> None:
    with serving() as (server, board):
        assert server.address == f"http://127.0.0.1:{server.server_port}/"
        status, text, headers = ask(server)
        assert (status, text) == (200, "<p>the page</p>")
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
        assert ask(server, "/trend.json")[1] == '{"times":[]}'
        board.show('{"now":1}')
        assert ask(server, "/now.json")[1] == '{"now":1}'
        assert ask(server, "/../../etc/passwd")[0] == 404
        assert ask(server, method="POST")[0] == 501


@pytest.mark.parametrize(
    "name", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "192.168.1.2", "[::1"]
)
def test_another_name_for_this_server_is_refused(name: str) -> None:
    with serving() as (server, _):
        status, text, _ = ask(server, Host=name)
        assert status in (400, 421)
        assert "the page" not in text


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]"])
def test_this_machines_own_names_are_known(name: str) -> None:
    with serving() as (server, _):
        assert ask(server, Host=f"{name}:{server.server_port}")[0] == 200


def test_beyond_this_machine_a_token_is_asked_for_and_then_kept_in_a_cookie() -> None:
    with serving("0.0.0.0") as (server, _):
        assert server.token is not None
        assert server.address.endswith(f"?token={server.token}")
        for path in ("/", "/now.json", "/events", "/?token=", "/?token=wrong", f"/?token={server.token}x"):
            assert ask(server, path)[0] == 401
        assert ask(server, Cookie=f"{COOKIE}=wrong")[0] == 401
        assert ask(server, Cookie="\x00;=;")[0] == 401
        status, _, headers = ask(server, f"/?token={server.token}")
        assert (status, headers["Location"]) == (303, "/")
        assert "HttpOnly" in headers["Set-Cookie"]
        assert "SameSite=Strict" in headers["Set-Cookie"]
        assert ask(server, Cookie=headers["Set-Cookie"].split(";")[0])[:2] == (200, "<p>the page</p>")
        assert ask(server, Authorization=f"Bearer {server.token}")[0] == 200
        assert ask(server, Host="evil.example", Authorization=f"Bearer {server.token}")[0] == 421


def test_each_server_has_a_token_of_its_own() -> None:
    with serving("0.0.0.0") as (one, _), serving("0.0.0.0") as (other, _):
        assert one.token != other.token
        assert len(one.token or "") >= 32


def test_every_reader_gets_the_latest_message_and_then_each_new_one() -> None:
    with serving() as (server, board):
        board.show("1")
        with listening(server) as one, listening(server) as other:
            assert next_message(one) == next_message(other) == "1"
            board.show("2")
            assert next_message(one) == next_message(other) == "2"


def test_a_slow_reader_misses_messages_and_keeps_nobody_waiting() -> None:
    with serving() as (server, board), listening(server) as slow:
        board.show("first")
        assert next_message(slow) == "first"
        for number in range(200):
            board.show(f"{number} " + 100_000 * "x")  # 20 MB that nobody reads
        board.show("last")
        assert ask(server, "/now.json")[1] == "last"
        while not next_message(slow).startswith("last"):
            pass


def test_readers_that_leave_free_their_places() -> None:
    with serving() as (server, board):
        for _ in range(100):  # more than are served at once
            with socket.create_connection(("127.0.0.1", server.server_port), timeout=PATIENCE_S) as link:
                link.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
                assert link.recv(15).startswith(b"HTTP/1.0 200")
            board.show("x")
            time.sleep(0.005)
        assert ask(server)[0] == 200


def test_an_address_that_is_taken_is_said() -> None:
    with serving() as (server, _), pytest.raises(DeviceError, match="a port that are free"):
        LiveServer("", Board(), str, port=server.server_port)
