"""The live page's server: a page, its trend, and a stream of events, to this machine unless told otherwise.

Only GET is answered, and nothing is read from a file. Beyond this machine a token is asked for. The Host header must be
a name of this server: a page of another site whose name was made to point here (DNS rebinding) is refused.
"""

import http.cookies
import ipaddress
import logging
import secrets
import socket
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from lidarspectra.errors import DeviceError
from lidarspectra.workflow.live.board import Board

MAX_CONNECTIONS = 64
REQUEST_LIMIT_S = 10.0  # [s] for a request to come, and for a reader to take what it is sent
HEARTBEAT_S = 10.0  # [s] after which a stream without news sends a comment, to notice readers that are gone
RETRY_MS = 1000  # [ms] after which a page asks again for a stream that ended
COOKIE = "lidarspectra_live"
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}

logger = logging.getLogger(__name__)


class LiveServer(ThreadingHTTPServer):
    """Serves a page.

    Parameters
    ----------
    page : str
        HTML.
    board : Board
        Its messages are sent as events 'now'.
    trend : callable
        Gives JSON; must be safe to be called from any thread.
    host : str
        Address or name to listen at. Beyond this machine a token is made.
    port : int
        0 for any that is free.

    Raises
    ------
    DeviceError
        If the address cannot be listened at.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(
        self, page: str, board: Board, trend: Callable[[], str], *, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self.page = page.encode("utf-8")
        self.board = board
        self.trend = trend
        self.host = host
        self.token = None if is_of_this_machine(host) else secrets.token_urlsafe(24)
        self._free = threading.BoundedSemaphore(MAX_CONNECTIONS)
        if ":" in host:
            self.address_family = socket.AF_INET6
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as cause:
            raise DeviceError(
                expected="an address and a port that are free",
                found=getattr(cause, "strerror", None) or str(cause),
                where=f"{host}:{port}",
                todo="Choose another --port, or 0 for any; --host is an address of this machine.",
            ) from cause

    @property
    def address(self) -> str:
        """What to open in a browser; with the token where there is one."""
        name = socket.gethostname() if self.host in ("0.0.0.0", "::") else self.host
        name = f"[{name}]" if ":" in name else name
        asked = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.server_port}/{asked}"

    def knows(self, host_header: str | None) -> bool:
        """Whether a Host header names this server."""
        try:
            name = urlsplit(f"//{host_header or ''}").hostname or ""
        except ValueError:  # half an address in brackets
            return False
        if is_of_this_machine(self.host):
            return is_of_this_machine(name)
        own = socket.gethostname().lower()
        return _is_address(name) or name in {self.host.lower(), own, f"{own.partition('.')[0]}.local", "localhost"}

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve in a thread of its own, unless too many are served already."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # no thread to be had
            self._free.release()
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve, then let the next one in."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Note readers that went away in the log, and nowhere else."""
        logger.debug("request of %s", client_address, exc_info=True)


def is_of_this_machine(host: str) -> bool:
    """Whether a name or address is of this machine alone: localhost, 127.0.0.1, ::1."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: LiveServer
    timeout = REQUEST_LIMIT_S
    server_version = "LiDARSpectra"
    sys_version = ""

    def do_GET(self) -> None:
        """Answer."""
        try:
            parts = urlsplit(self.path)
        except ValueError:
            self._say(HTTPStatus.BAD_REQUEST, "That is no address.")
            return
        if not self.server.knows(self.headers.get("Host")):
            self._say(HTTPStatus.MISDIRECTED_REQUEST, "This server has another name.")
        elif not self._is_allowed(parse_qs(parts.query).get("token", [""])[0]):
            self._say(HTTPStatus.UNAUTHORIZED, "Open the address that 'lidarspectra live' printed, with its token.")
        elif parts.path == "/" and "token" in parse_qs(parts.query):
            self._remember()
        elif parts.path == "/":
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", self.server.page)
        elif parts.path == "/trend.json":
            self._send(HTTPStatus.OK, "application/json", self.server.trend().encode("utf-8"))
        elif parts.path == "/now.json":
            self._send(HTTPStatus.OK, "application/json", self.server.board.after(-1, 0.0)[1].encode("utf-8"))
        elif parts.path == "/events":
            self._stream()
        else:
            self._say(HTTPStatus.NOT_FOUND, "There is no such page.")

    def _is_allowed(self, asked: str) -> bool:
        token = self.server.token
        if token is None:
            return True
        cookies = http.cookies.SimpleCookie()
        try:
            cookies.load(self.headers.get("Cookie", ""))
        except http.cookies.CookieError:
            return False
        bearer = self.headers.get("Authorization", "").removeprefix("Bearer ")
        kept = cookies[COOKIE].value if COOKIE in cookies else ""
        given = [each.encode("utf-8", errors="surrogateescape") for each in (asked, kept, bearer)]
        return any(secrets.compare_digest(each, token.encode()) for each in given)

    def _remember(self) -> None:
        """Keep the token in a cookie, and take it out of the address, which a browser shows and remembers."""
        self.send_response(HTTPStatus.SEE_OTHER)
        self.send_header("Location", "/")
        if self.server.token is not None:
            self.send_header("Set-Cookie", f"{COOKIE}={self.server.token}; HttpOnly; SameSite=Strict; Path=/")
        self._end_headers(0)

    def _stream(self) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream; charset=utf-8")
        self._end_headers(None)
        self.wfile.write(f"retry: {RETRY_MS}\n\n".encode())
        version = 0
        while not self.server.board.is_closed:
            newer, message = self.server.board.after(version, HEARTBEAT_S)
            text = f"event: now\ndata: {message}\n\n" if newer > version else ": still here\n\n"
            version = newer
            self.wfile.write(text.encode("utf-8"))
            self.wfile.flush()

    def _say(self, status: HTTPStatus, words: str) -> None:
        self._send(status, "text/plain; charset=utf-8", (words + "\n").encode("utf-8"))

    def _send(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self._end_headers(len(content))
        self.wfile.write(content)

    def _end_headers(self, length: int | None) -> None:
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing on the terminal; the address of a request may have a token."""
        logger.debug("request from %s", self.client_address[0])
