"""What the bench answers where it cannot do what is asked, and how it keeps what is dropped.

Truth: statuses of HTTP, and modes of files.
Every server must end without a word on standard error, so that none of its answers was a traceback.
"""

from __future__ import annotations

import http.client
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.support.import_files import decay
from tests.support.served import Bench
from tunnel_lab.bench.workspace import Session

ROWS = "\n".join(f"{t:.3f},{y:.6f}" for t, y in zip(*decay(1), strict=True))
LOG = f"time_s,yaw_rad\n{ROWS}\n".encode()


def asked(
    served: Bench, path: str, method: str = "GET", body: bytes = b"", kind: str = "text/plain"
) -> tuple[int, str]:
    """Status and text of an answer."""
    connection = http.client.HTTPConnection(served.base.removeprefix("http://"), timeout=60)
    port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\?token=(.*)", served.address).groups()
    connection.request(
        method,
        path,
        body,
        {"Cookie": f"tunnel-bench-{port}={token}", "Content-Type": kind, "Connection": "close"},
    )
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


def upload(
    served: Bench, files: Sequence[tuple[bytes, bytes]], path: str = "/upload", end: bytes = b"--B--\r\n"
) -> tuple[int, str]:
    parts = b"".join(
        b'--B\r\nContent-Disposition: form-data; name="f"; filename="'
        + name
        + b'"\r\n\r\n'
        + content
        + b"\r\n"
        for name, content in files
    )
    return asked(served, path, "POST", parts + end, "multipart/form-data; boundary=B")


@pytest.mark.parametrize(
    ("path", "status", "said"),
    [
        ("/nothing", 404, "There is no such page."),
        ("/a/b/c", 404, "There is no such page."),
        ("/two/nothing", 404, "There is no such page."),
        ("/static/bench/../server.py", 404, "There is no such page."),
        ("/no/records", 404, "there is no campaign &#x27;no&#x27;"),
        ("/no/report.html", 404, "there is no campaign"),
        ("/no/fit.html", 404, "there is no campaign"),
        ("/%ff%00%0a/report.html", 404, "there is no campaign"),
        ("/%2e%2e/report.html", 404, "there is no campaign"),
        ("/<script>/report.html", 404, "&lt;script&gt;"),
        ("/plain/report.html", 409, "Identify the campaign"),
        ("/plain/fit.html", 409, "Diagnose the campaign first."),
        ("/plain/report", 409, "Identify the campaign"),
        ("/odd/fit.html", 409, "odd.diagnosis.json"),
    ],
)
def test_what_is_not_there_is_said_on_a_page(served: Bench, path: str, status: int, said: str) -> None:
    found, page = asked(served, path)
    assert found == status
    assert said in page
    assert '<link rel="stylesheet" href="/static/bench/bench.css">' in page
    for secret in ("Traceback", "site-packages", str(served.folder), served.address.partition("=")[2]):
        assert secret not in page


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "POST"])
def test_another_method_is_refused_in_one_line(served: Bench, method: str) -> None:
    status, words = asked(served, "/two/report.html", method)
    assert (status, words) == (405, "This address does not take such a request.\n")


def test_dropped_files_are_kept_for_their_owner_alone(served: Bench) -> None:
    assert upload(served, [(b"kept.csv", LOG), (b"more.csv", LOG)]) == (200, "/kept/records")
    assert upload(served, [(b"third.csv", LOG)], "/kept/upload") == (200, "/kept/records")
    uploads = Session(served.folder, "kept").uploads
    assert uploads.stat().st_mode & 0o777 == 0o700
    found = {path.name: path.stat().st_mode & 0o777 for path in uploads.iterdir()}
    assert found == dict.fromkeys(("kept.csv", "more.csv", "third.csv"), 0o600)
    assert (uploads / "kept.csv").read_bytes() == LOG


@pytest.mark.parametrize(
    ("sent", "place"),
    [
        (b"../../evil.csv", "evil"),
        (b"a\0b\nc=.csv", "a_b_c"),
        (b"=cmd.csv", "cmd"),
        (b"\xff\xed\xa0\x80.csv", "%C3%BF%C3%AD"),
        (b"", "file"),
    ],
)
def test_a_hostile_name_is_a_plain_file_of_the_workspace(served: Bench, sent: bytes, place: str) -> None:
    status, answer = upload(served, [(sent, LOG)])
    assert (status, answer) == (200, f"/{place}/records")
    assert asked(served, answer)[0] == 200


def test_files_dropped_at_the_same_time_are_campaigns_of_their_own(served: Bench) -> None:
    with ThreadPoolExecutor(6) as at_once:
        answers = list(at_once.map(lambda _: upload(served, [(b"same.csv", LOG)]), range(6)))
    assert sorted(answers) == [(200, f"/same{end}/records") for end in ("-2", "-3", "-4", "-5", "-6", "")]


@pytest.mark.parametrize(
    ("files", "path", "end", "status", "said"),
    [
        ([], "/upload", b"--B--\r\n", 400, "No file"),
        ([(b"cut.csv", LOG)], "/upload", b"", 400, "No file"),
        ([(b"cut.csv", LOG)], "/nobody/upload", b"--B--\r\n", 404, "there is no campaign"),
        ([(b"cut.csv", LOG), (b"cut.csv", LOG)], "/upload", b"--B--\r\n", 409, "two files of one name"),
        (
            [(b"%d.csv" % number, b"") for number in range(1001)],
            "/upload",
            b"--B--\r\n",
            400,
            "Too many files",
        ),
    ],
)
def test_what_is_not_an_upload_is_refused(
    served: Bench, files: Sequence[tuple[bytes, bytes]], path: str, end: bytes, status: int, said: str
) -> None:
    before = sorted(served.folder.iterdir())
    found, words = upload(served, files, path, end)
    assert (found, words.count("\n")) == (status, 1)
    assert said in words
    assert sorted(served.folder.iterdir()) == before


def test_a_form_without_a_file_is_refused(served: Bench) -> None:
    form = "application/x-www-form-urlencoded"
    assert asked(served, "/upload", "POST", b"a=1", form) == (400, "No file is in the request.\n")


@pytest.mark.parametrize("content", [b"full at the second file", b"1" * 3_000_000])
def test_a_full_disk_is_said_and_nothing_is_half_kept(served: Bench, content: bytes) -> None:
    before = sorted(served.folder.iterdir())
    status, words = upload(served, [(b"first.csv", LOG), (b"second.csv", content)])
    assert (status, words) == (507, "The disk is full: nothing was kept. Free some space, and try again.\n")
    assert sorted(served.folder.iterdir()) == before


def test_a_full_disk_leaves_the_files_kept_before(served: Bench) -> None:
    assert upload(served, [(b"before.csv", LOG)])[0] == 200
    assert upload(served, [(b"before.csv", b"new"), (b"full.csv", b"full")], "/before/upload")[0] == 507
    (kept,) = Session(served.folder, "before").uploads.iterdir()
    assert kept.read_bytes() == LOG


def test_a_workspace_that_is_gone_is_said(served: Bench) -> None:
    elsewhere = served.folder.rename(served.folder.with_name("elsewhere"))
    try:
        status, page = asked(served, "/")
        assert (status, "the folder cannot be read" in page) == (409, True)
        assert upload(served, [(b"a.csv", LOG)])[0] == 409
    finally:
        elsewhere.rename(served.folder)
