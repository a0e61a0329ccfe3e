"""Files are written completely or not at all: one room writes them; its tests interrupt it and fill the disk."""

from __future__ import annotations

import ast
import re

from tests.support.sources import ROOT, modules, parsed

WRITING = {"write_text", "write_bytes", "O_WRONLY", "fdopen"}
#: Into a folder that takes its place whole, or that is removed; and logs, which are appended to.
OTHERS = {
    "tunnel_sim/files/campaign_folder.py": "in whole_folder",
    "tunnel_lab/report/page.py": "for Chromium, in a temporary folder",
    "tunnel_lab/bench/work.py": "a log",
    "tunnel_lab/logged.py": "a log",
    "tunnel_lab/cli.py": "to the null device",
    "tunnel_sim/sandbox.py": "to a pipe",
}
PACKAGES = ("tunnel_sim", "identification", "diagnosis", "tunnel_lab")


def writes(tree: ast.Module) -> bool:
    """Whether anything in a file opens another for writing."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in WRITING:
            return True
        if isinstance(node, ast.Call) and "open" in (
            getattr(node.func, "attr", ""),
            getattr(node.func, "id", ""),
        ):
            modes = [one.value for one in node.args if isinstance(one, ast.Constant)]
            if any(re.fullmatch("[rwaxbt+]*[wax+][bt+]*", str(mode)) for mode in modes):
                return True
    return False


def test_only_the_room_of_writing_writes_files() -> None:
    places = {path.relative_to(ROOT).as_posix(): path for path in modules().values()}
    texts = {name: path.read_text("utf-8") for name, path in places.items() if name.startswith(PACKAGES)}
    opening = {name for name, text in texts.items() if any(word in text for word in (*WRITING, "open("))}
    found = {name for name in opening if writes(parsed(places[name]))}
    assert found == {"tunnel_sim/files/writing.py", *OTHERS}


def test_a_file_that_is_written_elsewhere_is_found() -> None:
    for line in (
        "path.write_text(words)",
        "open(name, 'w')",
        "path.open('ab')",
        "os.open(name, os.O_WRONLY)",
    ):
        assert writes(ast.parse(line)), line
    for line in ("path.open('rb')", "open(name)", "write_whole(path, content)", "files.open(b'x')"):
        assert not writes(ast.parse(line)), line
