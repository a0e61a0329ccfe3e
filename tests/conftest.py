"""One thread of linear algebra in each process, and as many processes as keep every core at work."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from tests.skips import pytest_make_collect_report, pytest_runtest_makereport  # noqa: F401

# Set before NumPy loads, and handed on to the workers and to every command that a test starts.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# Without compiled files on the disk, every command that a test starts compiles the program again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


# A loaded machine may take a second over one example.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# A million examples of the fuzzers, which have 24 tests of readers and of `identify`.
settings.register_profile("long", settings.get_profile("patient"), max_examples=42_000)
settings.load_profile("patient")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Thousands of tests live until the end: the garbage collector would go over them again and again.

    It comes after 100,000 new objects and not after 700: a figure has thousands.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(100_000)
        gc.enable()


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Files in a browser go to one worker: it starts one bench, and no other waits for the browser."""
    from xdist.scheduler import LoadFileScheduling

    class PagesTogether(LoadFileScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return "pages" if "/bench/" in file or file.endswith("/test_browser.py") else file

    return PagesTogether(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.fixture
def in_a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """MuJoCo writes its log into the working directory."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def models_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read models without the process with limits, which takes half a second to start and has tests of its own."""
    from tunnel_sim.engine import joint_model

    joint_model.prepare()
    monkeypatch.setattr(joint_model, "in_sandbox", lambda work, given, parts, **_: work(given, parts))


@pytest.fixture
def unexamined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Identify records as they are: their examination takes most of the time, and has tests of its own."""
    from identification import identifying
    from identification.examination.examine import Examined

    monkeypatch.setattr(identifying, "examine", lambda campaign: Examined(campaign, ()))


@pytest.fixture
def with_odd_runs() -> None:
    """Beside `causes_alone`: runs that differ from the others as a whole are sought all the same."""


@pytest.fixture
def causes_alone(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Diagnose without a formula for the residual, MuJoCo's simulation of the answer, and a search for odd runs.

    The first takes most of the time where a gap is not explained, each of the others up to a fifth where it is.
    They change neither causes nor coefficients where no run is odd, and have tests of their own
    (``test_explain.py``, ``test_closing.py``, ``test_odd_run.py``).
    """
    _with_causes_alone(monkeypatch, odd_runs="with_odd_runs" in request.fixturenames)


@pytest.fixture(scope="module")
def causes_alone_throughout(request: pytest.FixtureRequest) -> Iterator[None]:
    """The same for all tests of a file, and for the answers that they share."""
    with pytest.MonkeyPatch.context() as patch:
        _with_causes_alone(patch, odd_runs="with_odd_runs" in request.fixturenames)
        yield


def _with_causes_alone(patch: pytest.MonkeyPatch, *, odd_runs: bool) -> None:
    from diagnosis.findings import closing
    from diagnosis.model.parameters import Point
    from diagnosis.remainder import ways

    for search in ("closable", "closable_driven"):
        patch.setattr(ways, search, lambda *_, **__: None)

    def by_the_integrator_of_the_fits(problem: Any, common: Any, release: Any) -> list[Any]:
        return [problem.predict([Point(row, release)])[0][run] for run, row in enumerate(common)]

    patch.setattr(closing, "mujoco_blocks", by_the_integrator_of_the_fits)
    if not odd_runs:
        patch.setattr("diagnosis.search.disturbed.odd_alone", lambda *_: ())
        patch.setattr("diagnosis.search.investigate.odd_runs", lambda *_: ())


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without pictures: drawing takes most of the time, and has tests of its own."""
    from tunnel_lab.report import page

    monkeypatch.setattr(page, "diagnosis_figures", lambda answer: dict.fromkeys(answer.pictures))
    monkeypatch.setattr(page, "inline_svg", lambda *_: "")
