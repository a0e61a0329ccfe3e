"""The golden set: what its comparison finds, and what it leaves out. Truth: folders and documents written here."""

from __future__ import annotations

import pytest

from benchmarks.golden import main, normalised


def test_seconds_versions_and_hashes_are_left_out_and_settings_kept():
    document = {
        "causes": ["x"],
        "seconds": {"nominal": 1.25},
        "provenance": {
            "versions": {"numpy": "2"},
            "sha256": {"runs/a.csv": "0"},
            "settings": {"gap.rate": 0.1},
        },
    }
    kept = {"causes": ["x"], "seconds": {}, "provenance": {"settings": {"gap.rate": 0.1}}}
    assert normalised(document) == kept
    assert normalised({"causes": []}) == {"causes": []}


def folder(path, **files):
    (path / "campaign").mkdir(parents=True)
    for name, text in {"document": "{}", **files}.items():
        (path / "campaign" / f"{name}.json").write_text(text)
    return str(path)


def test_a_comparison_finds_changed_and_missing_files(tmp_path, capsys):
    base = folder(tmp_path / "a", text="one\ntwo\n")
    assert main(["compare", base, folder(tmp_path / "b", text="one\ntwo\n")]) == 0
    assert capsys.readouterr().out == "1 campaigns: 2 files same, 0 differ\n"
    assert main(["compare", base, folder(tmp_path / "c", text="one\nthree\n")]) == 1
    assert "campaign/text.json: differs\n    - two\n    + three\n" in capsys.readouterr().out
    assert main(["compare", base, folder(tmp_path / "d")]) == 1
    (tmp_path / "e").mkdir()
    assert main(["compare", base, str(tmp_path / "e")]) == 1


@pytest.mark.parametrize(("what", "missing"), [("compare", 0), ("compare", 1), ("faces", 0)])
def test_a_folder_that_is_not_there_is_refused_and_not_made(what, missing, tmp_path, capsys):
    places = [folder(tmp_path / "a"), str(tmp_path / "b")]
    places[missing] = str(tmp_path / "none")
    with pytest.raises(SystemExit) as stopped:
        main([what, *places])
    assert stopped.value.code == 2
    assert "none: no " in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
