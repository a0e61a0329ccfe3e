"""Where no test may be skipped, a skip fails; what the tests need is installed.

Truth: tests and programs made here.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.skips import PLATFORM, VARIABLE

ROOT = Path(__file__).parents[2]
SKIPPED = """
import pytest

def test_passes(): pass

@pytest.mark.skipif(True, reason="there is no Chromium")
def test_marked(): pass

@pytest.fixture
def browser(): pytest.skip("there is no Chromium")

def test_by_a_fixture(browser): pass

def test_inside(): pytest.importorskip("no_such_package")

@pytest.mark.skipif(True, reason="platform: there is no /proc")
def test_allowed(): pass

@pytest.mark.xfail(reason="known")
def test_known(): assert False
"""
WHOLE_FILE = "import pytest\npytest.importorskip('no_such_package')\ndef test_never(): pass\n"


def outcome(folder: Path, value: str) -> list[str]:
    """Counts of the last line of pytest on two files of tests, such as ``3 failed``."""
    (folder / "test_skipped.py").write_text(SKIPPED)
    (folder / "test_whole_file.py").write_text(WHOLE_FILE)
    (folder / "pytest.ini").write_text("[pytest]\n")
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "tests.skips",
        "--continue-on-collection-errors",
        folder,
    ]
    given = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")} | {
        VARIABLE: value
    }
    done = subprocess.run(words, cwd=ROOT, env=given, capture_output=True, text=True, check=False)
    return sorted(done.stdout.splitlines()[-1].partition(" in ")[0].split(", "))


def test_a_skip_fails_where_none_may_be_unless_its_reason_is_allowed(tmp_path: Path) -> None:
    assert outcome(tmp_path, "") == ["1 passed", "1 xfailed", "5 skipped"]
    assert outcome(tmp_path, "1") == ["1 failed", "1 passed", "1 skipped", "1 xfailed", "3 errors"]


def test_no_missing_package_skips_a_test() -> None:
    """The extra ``dev`` holds what the tests import."""
    found = [path for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__)]
    assert len(found) > 100
    assert [path.name for path in found if "importorskip" in path.read_text("utf-8")] == []


def installation(
    tmp_path: Path, apt: str | None, *, browser: str | None = None, user: int = 0
) -> tuple[int, str]:
    """Exit status and messages of ``.ci/system`` on a system with these programs only."""
    programs = tmp_path / "bin"
    programs.mkdir(exist_ok=True)
    for name in ("bash", "grep", "chmod"):
        shutil.copy(shutil.which(name), programs / name)
    scripts = {"uname": "echo Linux", "ldconfig": "echo libEGL.so.1", "id": f"echo {user}", "apt-get": apt}
    for name, text in (scripts | {"chromium": browser}).items():
        if text is not None:
            (programs / name).write_text(f"#!/bin/bash\n{text}\n")
            (programs / name).chmod(0o755)
    words, given = ["/bin/bash", ROOT / ".ci" / "system"], {"PATH": str(programs)}
    done = subprocess.run(words, env=given, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


INSTALLS = """echo "$@" >> "${0%/*}/calls"
[ "$1" = update ] || { echo "#!/bin/bash" > "${0%/*}/chromium"; chmod +x "${0%/*}/chromium"; }"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason=f"{PLATFORM}: there is no apt-get")
def test_chromium_is_installed_where_it_is_missing(tmp_path: Path) -> None:
    assert installation(tmp_path, INSTALLS) == (0, "")
    update, install = (tmp_path / "bin" / "calls").read_text().splitlines()
    assert update.startswith("update")
    assert install.startswith("install --yes")
    assert install.endswith(" chromium")
    assert installation(tmp_path, INSTALLS) == (0, "")  # it is there now
    assert len((tmp_path / "bin" / "calls").read_text().splitlines()) == 2


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason=f"{PLATFORM}: there is no apt-get")
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"apt": None}, "no apt-get"),
        ({"apt": INSTALLS, "user": 1000}, "neither root nor sudo"),
        ({"apt": "exit 100"}, "could not install it"),
        ({"apt": "exit 0"}, "does not start after it was installed"),
        ({"apt": "exit 0", "browser": "echo Command requires the snap; exit 1"}, "does not start"),
    ],
)
def test_what_cannot_be_installed_is_one_clear_line(tmp_path: Path, given: dict[str, str], said: str) -> None:
    status, words = installation(tmp_path, **given)
    assert status == 1
    assert said in words
    assert words.startswith("ci: the tests need chromium")
    assert words.count("\n") == 1
