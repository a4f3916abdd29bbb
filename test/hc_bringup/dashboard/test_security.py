"""Who may look: every way in that is not the page's own is refused."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from typing import Any

import aiohttp
import pytest

Serve = Callable[..., Any]


def run(job: Callable[[aiohttp.ClientSession], Awaitable[Any]]) -> Any:
    """Run a job with a client that keeps cookies of 127.0.0.1."""

    async def main() -> Any:
        jar = aiohttp.CookieJar(unsafe=True)
        timeout = aiohttp.ClientTimeout(total=20)
        async with aiohttp.ClientSession(cookie_jar=jar, timeout=timeout) as session:
            return await job(session)

    return asyncio.run(main())


async def enter(session: aiohttp.ClientSession, served: Any, token: str) -> int:
    """Exchange the token for a cookie; returns the status."""
    answer = await session.post(
        f"{served.origin}/session", json={"token": token}, headers={"Origin": served.origin}
    )
    return answer.status


def test_the_page_itself_gets_in(serve: Serve, token: str) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        page = await session.get(served.origin)
        assert page.status == 200
        policy = page.headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'")
        assert "unsafe" not in policy
        text = await page.text()
        assert "<script defer src=" in text
        assert "style=" not in text
        assert " on" + "click" not in text
        answer = await session.post(
            f"{served.origin}/session", json={"token": token}, headers={"Origin": served.origin}
        )
        assert answer.status == 204
        cookie = answer.headers["Set-Cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert token not in cookie
        socket = await session.ws_connect(
            f"ws://{served.host}/ws", headers={"Origin": served.origin}
        )
        hello = await socket.receive_json()
        assert hello["op"] == "hello"
        assert served.backend.viewers == 1
        await socket.close()

    run(job)


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "", "LOCALHOST"])
@pytest.mark.parametrize("path", ["/", "/session", "/ws", "/app.js"])
def test_another_host_is_refused(serve: Serve, host: str, path: str) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        method = "POST" if path == "/session" else "GET"
        answer = await session.request(method, served.origin + path, headers={"Host": host})
        assert answer.status in (400, 421)

    run(job)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "file://", "http://127.0.0.1", "https://{host}", None]
)
def test_another_origin_is_refused(serve: Serve, token: str, origin: str | None) -> None:
    served = serve()
    headers = {} if origin is None else {"Origin": origin.format(host=served.host)}

    async def job(session: aiohttp.ClientSession) -> None:
        answer = await session.post(
            f"{served.origin}/session", json={"token": token}, headers=headers
        )
        assert answer.status == 403
        assert await enter(session, served, token) == 204
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await session.ws_connect(f"ws://{served.host}/ws", headers=headers)
        assert refused.value.status == 403

    run(job)


def test_a_request_that_the_browser_calls_cross_site_is_refused(serve: Serve, token: str) -> None:
    served = serve()
    headers = {"Origin": served.origin, "Sec-Fetch-Site": "cross-site"}

    async def job(session: aiohttp.ClientSession) -> None:
        url = f"{served.origin}/session"
        assert (await session.post(url, json={"token": token}, headers=headers)).status == 403

    run(job)


@pytest.mark.parametrize(
    "wrong", ["", "x", "\ud800", "token-of-the-tesT", None, 7, ["token-of-the-test"]]
)
def test_a_wrong_token_is_refused(serve: Serve, wrong: object) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        headers = {"Origin": served.origin}
        url = f"{served.origin}/session"
        answer = await session.post(url, json={"token": wrong}, headers=headers)
        assert answer.status == 403
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await session.ws_connect(f"ws://{served.host}/ws", headers=headers)
        assert refused.value.status == 401

    run(job)


def test_tokens_cannot_be_tried_out(serve: Serve, token: str) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        statuses = [await enter(session, served, f"guess {n}") for n in range(12)]
        assert statuses == [403] * 10 + [429] * 2
        assert await enter(session, served, token) == 429

    run(job)


@pytest.mark.parametrize("body", [b"", b"[1]", b"{", b"[" * 60_000, b"\xff\xfe", b'"token"'])
def test_bodies_that_are_no_token(serve: Serve, body: bytes) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        headers = {"Origin": served.origin}
        url = f"{served.origin}/session"
        assert (await session.post(url, data=body, headers=headers)).status == 403
        large = await session.post(url, data=b"x" * 200_000, headers=headers)
        assert large.status == 413

    run(job)


def test_a_cookie_that_is_no_text_is_refused_without_a_trace(
    serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    served = serve()
    request = (
        f"GET /ws HTTP/1.1\r\nHost: {served.host}\r\nOrigin: {served.origin}\r\n"
        f"Cookie: hc_dashboard_{served.port}="
    )
    with socket.create_connection(("127.0.0.1", served.port), timeout=20) as connection:
        connection.sendall(request.encode() + b"\xff\xfe\r\n\r\n")
        assert connection.recv(4096).split()[1] == b"401"
    assert not caplog.records


def test_paths_lead_nowhere_else(serve: Serve) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        for path in ("/../node.py", "/%2e%2e/node.py", "/page/app.js", "//etc/passwd", "/.git"):
            from yarl import URL

            url = URL(served.origin + path, encoded=True)
            assert (await session.get(url)).status in (400, 404)
        assert (await session.put(served.origin, headers={"Origin": served.origin})).status == 405

    run(job)


@pytest.mark.parametrize(
    "request_", [b"GET /%s HTTP/1.1\r\n\r\n" % (b"a" * 9000), b"\x16\x03\x01 no HTTP\r\n\r\n"]
)
def test_what_is_no_http_leaves_no_trace(
    serve: Serve, request_: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    """Any program on this machine could fill the terminal of the run with tracebacks."""
    served = serve()
    with socket.create_connection(("127.0.0.1", served.port), 10) as connection:
        connection.sendall(request_)
        answer = connection.recv(4096)
    assert b" 400 " in answer.split(b"\r\n")[0]
    assert caplog.records == []


@pytest.mark.parametrize(
    ("sent", "code"),
    [(b"binary", 1008), ("no JSON", 1008), ("[1]", 1008), ("x" * 100_000, 1009)],
)
def test_messages_that_are_no_requests_end_the_connection(
    serve: Serve, token: str, sent: str | bytes, code: int
) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        await enter(session, served, token)
        socket = await session.ws_connect(
            f"ws://{served.host}/ws", headers={"Origin": served.origin}
        )
        if isinstance(sent, bytes):
            await socket.send_bytes(sent)
        else:
            await socket.send_str(sent)
        async for _message in socket:
            pass
        assert socket.close_code == code

    run(job)
    assert served.backend.requests == []


def test_a_page_that_asks_too_often_is_cut_off(serve: Serve, token: str) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        await enter(session, served, token)
        socket = await session.ws_connect(
            f"ws://{served.host}/ws", headers={"Origin": served.origin}
        )
        for number in range(30):
            await socket.send_json({"op": "settings", "id": number})
        async for _message in socket:
            pass
        assert socket.close_code == 1008

    run(job)
    assert len(served.backend.requests) == 20


def test_viewers_are_bounded(serve: Serve, token: str) -> None:
    served = serve()

    async def job(session: aiohttp.ClientSession) -> None:
        await enter(session, served, token)
        headers = {"Origin": served.origin}
        sockets = [
            await session.ws_connect(f"ws://{served.host}/ws", headers=headers) for _ in range(16)
        ]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await session.ws_connect(f"ws://{served.host}/ws", headers=headers)
        assert refused.value.status == 503
        for one in sockets:
            await one.close()

    run(job)
