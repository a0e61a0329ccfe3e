"""The page on the paper: numbers of the printed equations, sections, and a run that is interrupted.

Truth: closed forms of a known run; the tables of the paper as printed.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tunnel_lab.paper import paper_page, rig_tables
from tunnel_lab.paper.paper_page import PaperPicture, PaperSection, signed
from tunnel_lab.paper.rig_tables import Oscillation, eq7, eq8, known_run, printed_transfer_function
from tunnel_sim.vocabulary.errors import TunnelError


def test_eqs_7_and_8_give_the_truth_once_eq_8_is_mended() -> None:
    known = known_run()
    assert known.cn_beta_of(eq7(known.on, known.off)) == pytest.approx(0.4719, rel=1e-12)
    assert known.cn_r_of(eq8(known.on, known.off, printed=False)) == pytest.approx(-0.1033, rel=1e-12)


def test_eq_8_as_printed_gives_the_wrong_sign() -> None:
    known = known_run()
    on, off = known.on.rate, known.off.rate
    wanted = -1.3863 * ((on / 0.6931) ** 2 - off / 0.6931)
    assert eq8(known.on, known.off, printed=True) == pytest.approx(wanted, rel=1e-3)
    assert known.cn_r_of(wanted) > 0.0 > known.cn_r


def test_eq_12_as_printed_has_its_poles_on_the_imaginary_axis() -> None:
    found = printed_transfer_function(0.1, 2.0)
    poles = np.roots([1.0, 0.0, 2.0 * 0.1 * 2.0 + 4.0])
    assert poles.real == pytest.approx([0.0, 0.0])
    assert abs(poles[0].imag) == pytest.approx(found.omega_n)
    assert found.half_time == np.inf


def test_an_oscillation_is_halved_in_its_half_time() -> None:
    one = Oscillation(5.0, 0.3)
    assert np.exp(-one.rate * one.half_time) == pytest.approx(0.5)
    assert (2.0 * np.pi * one.frequency) ** 2 + one.rate**2 == pytest.approx(25.0)


def test_the_rig_has_the_sizes_of_table_1_and_the_inertia_of_table_2(tmp_path: Path) -> None:
    *sizes, inertia = rig_tables.table_1(tmp_path).rows
    assert all(theirs == ours for _, _, theirs, ours in sizes)
    assert inertia[2:] == ("0.11", "0.1014")


def test_the_equations_say_what_is_printed_and_what_it_gives(tmp_path: Path) -> None:
    rows = {row[0]: row[3] for row in rig_tables.equations(tmp_path).rows}
    assert set(rows) == {"text after 6", "7", "8", "9", "12", "16"}
    assert rows["8"] == "Cnr +0.0842; corrected: −0.1033"
    assert "no damping" in rows["12"]


@pytest.mark.parametrize(("value", "text"), [(-0.0004, "0.000"), (-1.5, "−1.500"), (2.0, "+2.000")])
def test_numbers_with_signs(value: float, text: str) -> None:
    assert signed(value, 3) == text


def section(title: str, *files: str) -> PaperSection:
    pictures = tuple(PaperPicture(file=file, caption="<b>") for file in files)
    return PaperSection(
        title=title, about="a", theirs="<1>", ours="2", outcome="reproduced", words=(), pictures=pictures
    )


class Parts(dict[str, paper_page.Part]):
    """Three parts, and which were computed; the second draws a picture, the third is interrupted at first."""

    def __init__(self) -> None:
        super().__init__(one=self._one, two=self._two, three=self._three)
        self.called: list[str] = []

    def _one(self, _: Path) -> PaperSection:
        self.called.append("one")
        return section("One")

    def _two(self, folder: Path) -> PaperSection:
        (folder / "b.png").write_bytes(b"x")
        self.called.append("two")
        return section("Two", "b.png")

    def _three(self, _: Path) -> PaperSection:
        self.called.append("three")
        if self.called.count("three") == 1:
            raise KeyboardInterrupt
        return section("Three")


@pytest.fixture
def parts() -> Parts:
    return Parts()


NAMES = ("one", "two", "three")


def test_an_interrupted_page_goes_on_where_it_stopped(tmp_path: Path, parts: Parts) -> None:
    with pytest.raises(KeyboardInterrupt):
        paper_page.write_paper(tmp_path, parts, NAMES)
    assert not (tmp_path / paper_page.PAGE).exists()
    written, sections = paper_page.write_paper(tmp_path, parts, NAMES)
    assert parts.called == ["one", "two", "three", "three"]
    assert list(sections) == list(NAMES)
    text = written.read_text(encoding="utf-8")
    assert "&lt;1&gt;" in text
    assert "<b>" not in text
    (tmp_path / "b.png").unlink()
    paper_page.write_paper(tmp_path, parts, NAMES)
    assert parts.called[4:] == ["two"]  # only the part whose picture is gone


def test_a_part_of_another_version_is_computed_again(tmp_path: Path, parts: Parts) -> None:
    paper_page.write_paper(tmp_path, parts, ("one",))
    kept = tmp_path / "parts" / "one.json"
    kept.write_text(json.dumps(json.loads(kept.read_text()) | {"version": "0.0.0"}))
    _, sections = paper_page.write_paper(tmp_path, parts, ("one",))
    assert parts.called == ["one", "one"]
    assert list(sections) == ["one"]


@pytest.mark.parametrize("damage", ["{", '{"version": 1}', None])
def test_a_damaged_part_is_one_line(tmp_path: Path, parts: Parts, damage: str | None) -> None:
    paper_page.write_paper(tmp_path, parts, ("one",))
    kept = tmp_path / "parts" / "one.json"
    document = json.loads(kept.read_text())
    document["section"]["outcome"] = "splendid"
    kept.write_text(damage or json.dumps(document))
    if damage == '{"version": 1}':
        paper_page.write_paper(tmp_path, parts, ("one",))
        assert parts.called == ["one", "one"]
        return
    with pytest.raises(TunnelError, match=r"one\.json"):
        paper_page.write_paper(tmp_path, parts, ("one",))


def test_a_picture_stays_in_its_folder(tmp_path: Path, parts: Parts) -> None:
    paper_page.write_paper(tmp_path, parts, ("two",))
    kept = tmp_path / "parts" / "two.json"
    kept.write_text(kept.read_text().replace("b.png", "../b.png"))
    with pytest.raises(TunnelError, match="pattern"):
        paper_page.write_paper(tmp_path, parts, ("two",))
    assert parts.called == ["two"]
