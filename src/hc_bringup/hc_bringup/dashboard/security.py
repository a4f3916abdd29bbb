"""Who may look: exact Host and Origin, a token, a cookie, limits on size and rate.

Any page that a browser shows can open a connection to 127.0.0.1, and any user of the machine can
too. So every request must name this server exactly (against names that were made to point here),
every connection must come from this server's own page, and who looks must know the token that
stands in the address behind `#`, which a browser sends to nobody. The page hands it over once, for
a cookie that other sites cannot make the browser send.
"""

from __future__ import annotations

import hmac
import secrets
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any, Final

TOKEN_VARIABLE: Final = "HC_DASHBOARD_TOKEN"
"""Environment variable that gives a node its token: unlike a parameter, nobody else can read it."""
LARGEST_MESSAGE: Final = 64 * 1024
"""Bytes of a request's body and of a message from a page."""
_SESSION: Final = b"session of a page"
"""What the cookie says, signed with the token: it does not tell the token."""
WRONG_TOKENS: Final = 10
"""So many in a minute, and no token is looked at until the minute is over."""
MINUTE_S: Final = 60.0

HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
    "Cache-Control": "no-store",
    "Server": "hc",
}


def new_token() -> str:
    """Return a fresh random token: 256 bits."""
    return secrets.token_urlsafe(32)


def content_security_policy(host: str) -> str:
    """Return the policy of the page: its own files and its own connection, nothing inline."""
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        f"connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'; require-trusted-types-for 'script'"
    )


def _bytes_of(text: str) -> bytes:
    """Return what a request says as bytes; it may hold what is no character (a lone surrogate)."""
    return text.encode("utf-8", "surrogatepass")


class RefusedError(Exception):
    """Why a request is refused, with its HTTP status."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class RateLimit:
    """Allows a number of events in a sliding span of time."""

    def __init__(self, most: int, span_s: float) -> None:
        self._times: deque[float] = deque()
        self._most, self._span_s = most, span_s

    def full(self) -> bool:
        """Whether no event is allowed now."""
        while self._times and time.monotonic() - self._times[0] > self._span_s:
            self._times.popleft()
        return len(self._times) >= self._most

    def note(self) -> None:
        """Count an event."""
        self._times.append(time.monotonic())


class Gate:
    """Decides about requests; knows nothing of what is behind it."""

    def __init__(
        self, token: str, hosts: Collection[str], foreign_origins: Collection[str] = ()
    ) -> None:
        """Set up the gate.

        Args:
            token: the secret of the address.
            hosts: allowed values of the Host header, "127.0.0.1:8765" say.
            foreign_origins: origins of other programs that may connect with the token, those of
                a Foxglove or Lichtblick in a browser; never to the page's own connection.
        """
        self._token = token.encode()
        self.hosts = frozenset(hosts)
        self.foreign_origins = frozenset(foreign_origins)
        self._session = hmac.digest(self._token, _SESSION, "sha256").hex()
        self._wrong = RateLimit(WRONG_TOKENS, MINUTE_S)

    def check_host(self, headers: Any) -> str:
        """Return the host that a request names.

        Args:
            headers: the request's headers, a multidict.

        Raises:
            RefusedError: if it names another host, or several.
        """
        hosts = headers.getall("Host", [])
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            raise RefusedError(421, "this server goes by another name")
        return str(hosts[0])

    def check_origin(self, headers: Any, host: str, *, needed: bool) -> None:
        """Check that a request comes from the page itself.

        Args:
            headers: the request's headers, a multidict.
            host: the host that it names.
            needed: whether a request without an origin is refused.

        Raises:
            RefusedError: if it comes from elsewhere.
        """
        origins = headers.getall("Origin", [])
        own = origins == [f"http://{host}"] or not (origins or needed)
        if not own or headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise RefusedError(403, "this request comes from another site")

    def check_foreign_origin(self, headers: Any, host: str) -> None:
        """Check where a connection of another program comes from.

        Programs that are no browsers send no origin.

        Raises:
            RefusedError: if it is a browser's and its origin was not allowed.
        """
        origins = headers.getall("Origin", [])
        if not origins or origins == [f"http://{host}"]:
            return
        if len(origins) > 1 or origins[0] not in self.foreign_origins:
            raise RefusedError(
                403, f"start with --allow-origin {origins[0]} to let this program look"
            )

    def check_token(self, token: object) -> None:
        """Compare a token in constant time.

        Raises:
            RefusedError: if it is wrong, or too many wrong ones came.
        """
        if self._wrong.full():
            raise RefusedError(429, "too many wrong tokens: wait a minute")
        if not isinstance(token, str) or not hmac.compare_digest(_bytes_of(token), self._token):
            self._wrong.note()
            raise RefusedError(403, "this is not the token of the address")

    def open_session(self) -> str:
        """Return the secret of a session, for the cookie of a page that knew the token.

        It is the token's own, so that a page is let in again by the process that takes the place
        of this one with the same token: a dashboard that died in a run.
        """
        return self._session

    def check_session(self, cookies: Mapping[str, str], name: str) -> None:
        """Check the cookie of a request, in constant time.

        Raises:
            RefusedError: if it is missing or unknown.
        """
        if not hmac.compare_digest(_bytes_of(cookies.get(name, "")), self._session.encode()):
            raise RefusedError(401, "open the page by the address that was printed")
