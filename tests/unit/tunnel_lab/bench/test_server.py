"""Who may use the bench. Truth: a table of requests and what they are answered."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tunnel_lab.bench import server
from tunnel_lab.bench.server import Guard
from tunnel_sim.vocabulary.limits import UPLOAD_BYTES

HOST, TOKEN = "127.0.0.1:8050", "secret"
COOKIE = f"other=1; tunnel-bench-8050={TOKEN}"


def answer(
    headers: dict[str, str],
    query: str = "",
    kind: str = "http",
    method: str = "GET",
    path: str = "/rig/records",
) -> list[dict[str, Any]]:
    """What is sent in answer to a request; the guarded application sends ``passed``."""
    sent: list[dict[str, Any]] = []

    async def app(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "passed"})

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "query_string": query.encode(),
        "headers": [
            (name.encode(), value.encode("latin-1")) for name, value in ({"host": HOST} | headers).items()
        ],
    }
    asyncio.run(Guard(app, 8050, TOKEN)(scope, None, send))  # type: ignore[arg-type]
    return sent


def status(*given: Any, **named: Any) -> int:
    first = answer(*given, **named)[0]
    return {"passed": 200}.get(first["type"]) or first.get("status") or first["code"]


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({"cookie": COOKIE}, 200),
        ({"cookie": COOKIE, "host": "localhost:8050"}, 200),
        ({"cookie": COOKIE, "origin": f"http://{HOST}"}, 200),
        ({}, 403),
        ({"cookie": "tunnel-bench-8050=guess"}, 403),
        ({"cookie": f"tunnel-bench-8051={TOKEN}"}, 403),  # the bench of another port
        ({"cookie": COOKIE, "origin": "http://evil.example"}, 403),
        ({"cookie": COOKIE, "origin": "null"}, 403),
        ({"cookie": COOKIE, "origin": "http://localhost:8050"}, 403),  # the page of another host name
        ({"cookie": COOKIE, "host": "evil.example:8050"}, 421),  # a name that was bound to this machine
        ({"cookie": COOKIE, "host": "127.0.0.1"}, 421),
        ({"cookie": COOKIE, "content-length": str(UPLOAD_BYTES)}, 200),
        ({"cookie": COOKIE, "content-length": str(UPLOAD_BYTES + 1)}, 413),
        ({"cookie": COOKIE, "content-length": "-1"}, 411),
        ({"cookie": COOKIE, "content-length": "²"}, 411),
        ({"cookie": COOKIE, "content-length": "9" * 5000}, 411),
        ({"cookie": COOKIE, "transfer-encoding": "chunked"}, 411),
    ],
)
def test_a_request_is_answered_or_refused(headers: dict[str, str], expected: int) -> None:
    assert status(headers) == expected
    websocket = status(headers, kind="websocket")
    assert websocket == (200 if expected == 200 else 1008)


def test_the_token_moves_from_the_address_into_a_cookie() -> None:
    first, _ = answer({}, query=f"token={TOKEN}&page=2")
    headers = dict(first["headers"])
    assert first["status"] == 303
    assert headers[b"location"] == b"/rig/records?page=2"
    assert headers[b"set-cookie"].startswith(f"tunnel-bench-8050={TOKEN};".encode())
    assert b"HttpOnly" in headers[b"set-cookie"]
    assert b"SameSite=Strict" in headers[b"set-cookie"]
    assert status({}, query="token=guess") == 403
    assert status({}, query="token=") == 403


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ("/a\r\nX:1", b"/a%0D%0AX%3A1"),  # would end the header, and the server with it
        ("//evil.example", b"/evil.example"),
        ("/\\evil.example", b"/evil.example"),
        ("/prüfstand/a?b", b"/pr%C3%BCfstand/a%3Fb"),
        ("/\x00\ud800", b"/%00%3F"),
    ],
)
def test_the_address_without_the_token_is_the_same_and_of_this_server(path: str, place: bytes) -> None:
    first, _ = answer({}, query=f"token={TOKEN}", path=path)
    assert dict(first["headers"])[b"location"] == place


def test_a_refusal_is_one_line_and_does_not_echo_the_request() -> None:
    for headers in (
        {"host": "<script>"},
        {"origin": "<script>"},
        {"content-length": "9" * 15, "cookie": COOKIE},
    ):
        start, body = answer(headers)
        assert start["status"] in (403, 413, 421)
        assert body["body"].count(b"\n") == 1
        assert b"<" not in body["body"]


def test_a_report_is_served_without_the_rights_of_the_bench() -> None:
    policy = server._report(b"<p>").headers["content-security-policy"]
    stated = dict(part.strip().partition(" ")[::2] for part in policy.split(";"))
    assert stated["sandbox"] == "allow-scripts"  # without allow-same-origin: it has no cookie and no address
    assert stated["default-src"] == "'none'"
    assert "unsafe" not in stated["script-src"]
