"""Reading a table of springs: what is read, and the one line for what cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tunnel_lab.commands.paper import read_spring_table
from tunnel_sim.vocabulary.errors import TunnelError

HEADER = "spring,stiffness_N_m_per_rad,frequency_Hz\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "springs.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_is_read_in_any_order_of_columns(tmp_path: Path) -> None:
    text = "# measured on Monday\nfrequency_Hz,stiffness_N_m_per_rad\n0.5,1\n\n0.7, 2\n0.86,3\n"
    table = read_spring_table(written(tmp_path, text))
    assert table.names == ("1", "2", "3")
    assert table.stiffness == (1.0, 2.0, 3.0)
    assert table.frequency_hz == (0.5, 0.7, 0.86)


def test_springs_keep_their_names(tmp_path: Path) -> None:
    table = read_spring_table(written(tmp_path, HEADER + "soft,1,0.5\n,2,0.7\nhard,3,0.86\n"))
    assert table.names == ("soft", "2", "hard")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        (HEADER, "has 0 springs"),
        (HEADER + "1,1,0.5\n2,2,0.7\n", "has 2 springs; give three or more"),
        ("stiffness,frequency_Hz\n1,2\n", "unknown column 'stiffness'; did you mean 'stiffness_N_m_per_rad'"),
        ("spring,frequency_Hz\n1,2\n", "needs one column stiffness_N_m_per_rad"),
        ("frequency_Hz,frequency_Hz,stiffness_N_m_per_rad\n1,2,3\n", "needs one column frequency_Hz"),
        (HEADER + "1,1\n", "line 2: has 2 values"),
        (HEADER + "1,1,0.5\n2,x,0.7\n", "line 3: 'x' is not a number above zero"),
        (HEADER + "1,1,nan\n", "line 2: 'nan' is not a number above zero"),
        (HEADER + "1,-1,0.5\n", "line 2: '-1' is not a number above zero"),
        (HEADER + "1,1,inf\n", "line 2: 'inf' is not a number above zero"),
        (HEADER + "1,1,0\n", "line 2: '0' is not a number above zero"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(TunnelError) as caught:
        read_spring_table(written(tmp_path, text))
    assert message in str(caught.value)
    assert "springs.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="no such file"):
        read_spring_table(tmp_path / "springs.csv")


def test_a_folder_or_binary_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "springs.csv").write_bytes(b"\xff\xfe\x00\x81")
    for path in (tmp_path, tmp_path / "springs.csv"):
        with pytest.raises(TunnelError, match=r"cannot be read|not UTF-8"):
            read_spring_table(path)
