"""No test is left out unseen: where ``VWT_NO_SKIPS`` is set, as on CI, a skipped test fails.

Elsewhere a test may be skipped for want of what the machine has not, such as Chromium. A reason that begins with a
kind of `ALLOWED` is a skip everywhere.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TypeVar

import pytest

VARIABLE = "VWT_NO_SKIPS"
PLATFORM, USER, FILE_SYSTEM = "platform", "user", "file system"
ALLOWED = {
    PLATFORM: "what is tested exists on other systems only, such as /proc on Linux",
    USER: "one test needs root, another needs any other user",
    FILE_SYSTEM: "whether device nodes may be made and opened depends on how the folder is mounted",
}
"""The kinds of skips that no installation can prevent, and why."""
ReportT = TypeVar("ReportT", pytest.TestReport, pytest.CollectReport)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Iterator[None]:
    """Judge the skip of a test."""
    return judged((yield))  # type: ignore[func-returns-value]


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Iterator[None]:
    """Judge the skip of a file."""
    return judged((yield))  # type: ignore[func-returns-value]


def judged(report: ReportT) -> ReportT:
    """The report as a failure where it is of a skip for a reason that is not allowed."""
    if not (report.skipped and os.environ.get(VARIABLE)) or hasattr(report, "wasxfail"):
        return report
    reason = str(report.longrepr[2]).removeprefix("Skipped: ")
    if reason.partition(":")[0] not in ALLOWED:
        report.outcome = "failed"
        report.longrepr = f"skipped although {VARIABLE} is set: {reason}"
    return report
