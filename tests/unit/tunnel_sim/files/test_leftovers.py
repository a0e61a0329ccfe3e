"""What killed commands leave is cleared, and nothing else is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.reference.free_decays import Setting, campaign
from tests.skips import PLATFORM
from tests.support.killed import names_of_the_dead
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.writing import clear_leftovers, temporary_names, whole_folder, write_whole
from tunnel_sim.vocabulary.errors import TunnelError


def test_the_next_writer_clears_what_a_killed_one_left(tmp_path: Path) -> None:
    partial, _ = names_of_the_dead(tmp_path / "a.json")
    partial.write_text("half")
    folder, _ = names_of_the_dead(tmp_path / "campaign")
    (folder / "runs").mkdir(parents=True)
    write_whole(tmp_path / "b.json", b"{}")
    assert [path.name for path in tmp_path.iterdir()] == ["b.json"]


def test_a_folder_that_was_only_set_aside_is_put_back(tmp_path: Path) -> None:
    partial, replaced = names_of_the_dead(tmp_path / "campaign")
    partial.mkdir()
    replaced.mkdir()
    (replaced / "campaign.toml").write_text("the only copy")
    clear_leftovers(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["campaign"]
    assert (tmp_path / "campaign" / "campaign.toml").read_text() == "the only copy"


def test_a_folder_that_was_replaced_is_removed(tmp_path: Path) -> None:
    _, replaced = names_of_the_dead(tmp_path / "campaign")
    replaced.mkdir()
    (tmp_path / "campaign").mkdir()
    (tmp_path / "campaign" / "new").write_text("")
    clear_leftovers(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["campaign"]
    assert (tmp_path / "campaign" / "new").exists()


def test_what_runs_or_runs_elsewhere_or_is_the_users_stays(tmp_path: Path) -> None:
    own, _ = temporary_names(tmp_path / "a")
    dead, aside = names_of_the_dead(tmp_path / "a")
    machine = dead.name.split(".")[2].split("-")[0]
    kept = [
        own.name,
        dead.name.replace(machine, "0" * 8),  # of a process on another machine
        aside.name.replace(machine, "0" * 8),
        ".a.partial",
        ".a.12345678.partial",
        ".notes.part",
    ]
    for name in kept:
        (tmp_path / name).write_text("")
    clear_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason=f"{PLATFORM}: there is no /proc")
def test_a_number_that_another_process_has_by_now_does_not_protect(tmp_path: Path) -> None:
    own, _ = temporary_names(tmp_path / "a")
    head, start, tail = own.name.rsplit("-", 2)
    own.with_name(f"{head}-{int(start) + 1}-{tail}").write_text("of an earlier process of this number")
    clear_leftovers(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_names_stay_short_enough_for_the_disk(tmp_path: Path) -> None:
    target = tmp_path / ("é" * 120)  # 240 of 255 bytes
    write_whole(target, b"x")
    assert list(tmp_path.iterdir()) == [target]


def test_links_in_the_place_of_leftovers_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").write_text("")
    names_of_the_dead(tmp_path / "a")[0].symlink_to(tmp_path / "mine")
    clear_leftovers(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert (tmp_path / "mine" / "file").exists()


WRITER = """
import sys, time
from pathlib import Path
from tunnel_sim.files import writing
def stop(*_):
    print("now", flush=True)
    time.sleep(60)
target = Path(sys.argv[1])
if sys.argv[2] == "filling":
    with writing.whole_folder(target, replace=True) as folder:
        (folder / "file").write_text("new")
        stop()
rename, calls = Path.rename, []
def second(self, to):
    if calls: stop()
    calls.append(to)
    return rename(self, to)
Path.rename = second
with writing.whole_folder(target, replace=True) as folder:
    (folder / "file").write_text("new")
"""


@pytest.mark.parametrize("moment", ["filling", "between the two renamings"])
def test_a_real_kill(tmp_path: Path, moment: str) -> None:
    target = tmp_path / "campaign"
    target.mkdir()
    (target / "file").write_text("old")
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(target), moment], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "now\n"
        clear_leftovers(tmp_path)  # while it runs nothing of it is touched
        assert len(list(tmp_path.iterdir())) == 2
        assert target.exists() == (moment == "filling")
        os.kill(child.pid, signal.SIGKILL)
    begun = time.perf_counter()
    clear_leftovers(tmp_path)
    assert time.perf_counter() - begun < 5.0
    assert [path.name for path in tmp_path.iterdir()] == ["campaign"]
    assert (target / "file").read_text() == "old"


def test_an_interrupt_between_the_renamings_puts_the_old_folder_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "campaign"
    target.mkdir()
    (target / "file").write_text("old")
    rename = Path.rename

    def interrupted(self: Path, to: Path) -> Path:
        if self.name.endswith(".partial"):
            raise KeyboardInterrupt
        return rename(self, to)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_folder(target, replace=True) as folder:
        (folder / "file").write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["campaign"]
    assert (target / "file").read_text() == "old"


def test_a_command_that_refuses_an_occupied_folder_clears_first(tmp_path: Path) -> None:
    from tunnel_lab.commands import score, simulate

    names_of_the_dead(tmp_path / "trials.parquet")[0].write_text("half")
    score._parts(tmp_path, overwrite=False)
    assert list(tmp_path.iterdir()) == []
    names_of_the_dead(tmp_path / "campaign")[1].mkdir()
    with pytest.raises(TunnelError, match="exists already"):
        simulate.refuse_occupied(tmp_path / "campaign", overwrite=False)


def test_a_campaign_that_was_set_aside_is_not_overwritten_unasked(tmp_path: Path) -> None:
    data = campaign([Setting(16.12, 0.0)], duration=4.0, rate=200.0)
    folder = write_campaign(data, tmp_path / "c")
    folder.rename(names_of_the_dead(folder)[1])
    with pytest.raises(TunnelError, match="the folder exists"):
        write_campaign(data, folder)
    assert [path.name for path in tmp_path.iterdir()] == ["c"]
    assert len(read_campaign(folder).runs) == 1
