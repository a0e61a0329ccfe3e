"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import stat
import subprocess
import sys
import threading
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import polars as pl
import pytest

from tests.skips import FILE_SYSTEM, PLATFORM, USER
from tunnel_sim.files import writing
from tunnel_sim.files.writing import (
    output_folder,
    refuse_unwritable,
    remove_empty_folders,
    whole_folder,
    write_encoded,
    write_json,
    write_whole,
)
from tunnel_sim.vocabulary.errors import TunnelError


def test_a_file_is_written_and_nothing_else(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.bin", b"one")
    write_whole(tmp_path / "a.bin", b"two")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"two"


def test_a_failure_leaves_the_old_file_and_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_whole(tmp_path / "a.bin", b"old")

    def full(_self: Path, _target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(TunnelError, match="no space left on device"):
        write_whole(tmp_path / "a.bin", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"old"


def test_an_interrupt_leaves_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_self: Path, _target: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a.bin", b"new")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"missing/a\.json: cannot be written"):
        write_json(tmp_path / "missing" / "a.json", {})


def test_json_refuses_nan_before_it_touches_the_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "a.json", {"value": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_json_reads_back(tmp_path: Path) -> None:
    document = {"name": "Cnβ", "value": 0.495, "runs": [{"id": "r01"}]}
    assert json.loads(write_json(tmp_path / "a.json", document).read_text(encoding="utf-8")) == document


def test_an_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = output_folder(tmp_path / "a" / "b")
    assert folder.is_dir()
    assert list(folder.iterdir()) == []


def test_empty_folders_for_output_are_removed_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    output_folder(tmp_path / "mine")
    (output_folder(tmp_path / "full" / "of") / "it").write_text("")
    output_folder(output_folder(tmp_path / "mine" / "a" / "b") / "c")
    remove_empty_folders()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["full", "it", "mine", "of"]


@pytest.mark.parametrize("before", ["nothing", "empty"])
def test_of_two_writers_of_a_new_folder_one_is_refused(before: str, tmp_path: Path) -> None:
    target = tmp_path / "rig"
    if before == "empty":
        target.mkdir()

    def slow() -> None:
        with whole_folder(target, replace=False) as mine, whole_folder(target, replace=False) as quick:
            (mine / "slow").write_text("")
            (quick / "quick").write_text("")

    with pytest.raises(TunnelError, match="rig: the folder exists; another command has written it meanwhile"):
        slow()
    assert [path.name for path in target.iterdir()] == ["quick"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_is_no_output_folder(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(TunnelError, match="cannot be written"):
        output_folder(tmp_path / "a")


def test_a_symbolic_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target = tmp_path / "there" / "a.json"
    target.write_text("old")
    link, second = tmp_path / "link", tmp_path / "second"
    link.symlink_to(Path("there") / "a.json")
    second.symlink_to(link)
    assert write_whole(second, b"new") == second
    assert target.read_text() == "new"
    assert link.is_symlink()
    assert second.is_symlink()
    assert len(list((tmp_path / "there").iterdir())) == 1


def test_a_link_to_a_file_that_is_not_there_yet(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "a.json")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "a.json").read_text() == "new"
    assert (tmp_path / "link").is_symlink()


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for refused in (refuse_unwritable, lambda path: write_whole(path, b"")):
        with pytest.raises(TunnelError, match="cannot be written"):
            refused(tmp_path / "a")


@pytest.mark.parametrize("linked", [False, True])
def test_a_folder_is_refused(tmp_path: Path, linked: bool) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    path = tmp_path / "link" if linked else folder
    if linked:
        path.symlink_to(folder)
    for refused in (refuse_unwritable, lambda path: write_whole(path, b"")):
        with pytest.raises(TunnelError, match="is a folder, not a file; name a file"):
            refused(path)


def test_a_folder_that_takes_no_files_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(dir: Path) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(dir))

    monkeypatch.setattr(writing.tempfile, "TemporaryFile", full)
    for path in (tmp_path / "new.xml", Path(__file__)):
        with pytest.raises(TunnelError, match="cannot be written \\(permission denied"):
            refuse_unwritable(path)
    refuse_unwritable(Path(os.devnull))


def test_a_name_too_long_for_the_disk_is_one_line(tmp_path: Path) -> None:
    for refused in (refuse_unwritable, lambda path: write_whole(path, b"")):
        with pytest.raises(TunnelError, match="file name too long"):
            refused(tmp_path / ("a" * 300))


def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    refuse_unwritable(pipe)
    write_whole(pipe, b"content")
    reader.join(timeout=10.0)
    assert read == [b"content"]
    assert list(tmp_path.iterdir()) == [pipe]
    assert pipe.is_fifo()


def test_a_device_stays_a_device() -> None:
    write_whole(Path("/dev/null"), b"content")
    assert Path("/dev/null").is_char_device()


def test_a_device_node_of_root_stays_a_device_node(tmp_path: Path) -> None:
    node = tmp_path / "null"
    try:
        os.mknod(node, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        pytest.skip(f"{USER}: only root makes device nodes")
    try:
        write_whole(node, b"content")
    except TunnelError:
        pytest.skip(f"{FILE_SYSTEM}: devices are not opened here")
    assert node.is_char_device()
    assert list(tmp_path.iterdir()) == [node]


def child(code: str, *arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(words, check=False, text=True, **{"capture_output": True, **options})  # type: ignore[call-overload]


STANDARD_OUTPUT = """
from pathlib import Path
from tunnel_sim.files.writing import write_whole
print("before", flush=False)
write_whole(Path("/dev/stdout"), b"content\\n")
print("after")
"""


def test_standard_output_by_name_into_a_pipe_and_into_a_file(tmp_path: Path) -> None:
    assert child(STANDARD_OUTPUT).stdout == "before\ncontent\nafter\n"
    with (tmp_path / "out").open("w") as stream:
        child(STANDARD_OUTPUT, capture_output=False, stdout=stream)
    assert (tmp_path / "out").read_text() == "before\ncontent\nafter\n"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason=f"{PLATFORM}: there is no /dev/full")
def test_a_full_disk_is_one_line() -> None:
    with pytest.raises(TunnelError, match="/dev/full: cannot be written \\(no space left on device\\)"):
        write_whole(Path("/dev/full"), b"content")


class Panic(BaseException):
    """As libraries written in Rust raise it."""


@pytest.mark.parametrize(
    "error", [ValueError("odd\ntext"), Panic("no"), OSError("disk"), SyntaxError(), MemoryError()]
)
def test_whatever_a_writer_raises_is_one_line(tmp_path: Path, error: BaseException) -> None:
    def fails(stream: BinaryIO) -> None:
        stream.write(b"half")
        raise error

    with pytest.raises(TunnelError, match=r"a\.png: cannot be written \(") as raised:
        write_encoded(tmp_path / "a.png", fails)
    assert "\n" not in str(raised.value)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_writer_stays_interrupted(tmp_path: Path) -> None:
    def interrupted(_: BinaryIO) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_encoded(tmp_path / "a.png", interrupted)


def test_a_table_is_written_by_its_library(tmp_path: Path) -> None:
    frame = pl.DataFrame({"a": [1.0, 2.0]})
    write_encoded(tmp_path / "a.parquet", frame.write_parquet)
    assert pl.read_parquet(BytesIO((tmp_path / "a.parquet").read_bytes())).equals(frame)


def test_a_report_that_cannot_be_drawn_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tunnel_lab.report import page

    def fails(*_: object) -> str:
        raise ValueError("no such glyph")

    monkeypatch.setattr(page, "render_report", fails)
    with pytest.raises(TunnelError, match="cannot be written \\(ValueError: no such glyph\\)"):
        page.write_report({}, None, tmp_path / "a.html")
    assert list(tmp_path.iterdir()) == []
