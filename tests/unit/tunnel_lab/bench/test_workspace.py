"""Names and files of the bench. Truth: what file systems and addresses allow."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tunnel_lab.bench.workspace import new_session, open_session, safe_name, sessions
from tunnel_sim.files.reading import CAMPAIGN_FILE
from tunnel_sim.vocabulary.errors import TunnelError

HOSTILE = {
    "../../etc/passwd": "passwd",
    "..\\..\\boot.ini": "boot.ini",
    ".bashrc": "bashrc",
    "": "file",
    "...": "file",
    "con.csv": "file-con.csv",
    "LPT1": "file-LPT1",
    "a\0b\nc.csv": "a_b_c.csv",
    "<img src=x onerror=alert(1)>.csv": "img_src_x_onerror_alert_1_.csv",
    "$(rm -rf ~).csv": "rm_-rf_.csv",
    "-rf.csv": "rf.csv",
    "Messung März.csv": "Messung_März.csv",
    "log.csv": "log.csv",
}


@pytest.mark.parametrize(("given", "safe"), HOSTILE.items(), ids=range(len(HOSTILE)))
def test_a_hostile_name_becomes_a_plain_one(given: str, safe: str) -> None:
    assert safe_name(given) == safe


@settings(max_examples=40)
@given(st.text(max_size=300))
def test_a_safe_name_is_a_file_of_its_folder_and_stays(text: str) -> None:
    name = safe_name(text)
    assert Path(name).name == name
    assert 0 < len(name) <= 85
    assert name[0] not in ".-_"
    assert name.isprintable()
    assert not set(name) & set("/\\<>:\"|?*'&;$` %#\0")
    assert safe_name(name) == name


def test_sessions_are_campaigns_and_dropped_files(tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / CAMPAIGN_FILE).touch()
    (tmp_path / "dropped.uploads").mkdir()
    (tmp_path / "other").mkdir()
    assert [session.name for session in sessions(tmp_path)] == ["dropped", "rig"]
    assert open_session(tmp_path, "rig").imported
    assert new_session(tmp_path, "/x/rig.csv").name == "rig-2"
    assert new_session(tmp_path, "fresh.mat").name == "fresh"
    assert new_session(tmp_path, "end_.csv").name == "end"


@pytest.mark.parametrize("name", ["other", "..", "missing", "rig/../rig", "<b>"])
def test_an_address_names_a_session_or_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "other").mkdir()
    with pytest.raises(TunnelError, match="there is no campaign"):
        open_session(tmp_path, name)
