"""``tunnel train`` and ``identify --weights`` as a user meets them."""

import json

from tunnel_lab.cli import main

QUICK = ["--starts", "1", "--steps", "8"]


def test_trains_writes_both_files_and_says_what_came_of_it(tmp_path, capsys):
    out = tmp_path / "w.safetensors"
    assert main(["train", str(out), "--seed", "3", *QUICK]) == 0
    record = json.loads((tmp_path / "w.json").read_text())
    assert record["seed"] == 3
    said = capsys.readouterr().out
    assert f"{record['networks']['damping']['starts'][0]['effective_parameters']:.1f} of 541" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["w.json", "w.safetensors"]


def interrupted_at_the_fifth(monkeypatch):
    """Make the fifth step of a training interrupt it; a list with an entry for each step."""
    from identification.neural import train as module

    step, taken = module.advance_training, []

    def interrupted(progress, problem):
        taken.append(1)
        if len(taken) == 5:
            raise KeyboardInterrupt
        return step(progress, problem)

    monkeypatch.setattr(module, "advance_training", interrupted)
    return taken


def test_interrupted_and_gone_on_with_to_the_same_bits(tmp_path, monkeypatch, capsys):
    whole, out = tmp_path / "whole.safetensors", tmp_path / "w.safetensors"
    assert main(["train", str(whole), *QUICK]) == 0
    taken = interrupted_at_the_fifth(monkeypatch)
    assert main(["train", str(out), *QUICK]) == 130
    assert not out.exists()
    assert "the same command continues" in capsys.readouterr().err
    assert main(["train", str(out), "--seed", "9", *QUICK]) == 2
    assert "--restart" in capsys.readouterr().err
    assert main(["train", str(out), *QUICK]) == 0
    assert len(taken) == 5 + 16 - 4  # it did not begin anew
    assert out.read_bytes() == whole.read_bytes()
    assert not (tmp_path / "w.part.safetensors").exists()


def test_a_restart_gives_the_same_bits_and_takes_nothing_from_an_interrupted_training(tmp_path, monkeypatch):
    out = tmp_path / "w.safetensors"
    assert main(["train", str(out), *QUICK]) == 0
    whole, record = out.read_bytes(), out.with_suffix(".json").read_bytes()
    out.unlink()
    taken = interrupted_at_the_fifth(monkeypatch)
    assert main(["train", str(out), *QUICK]) == 130
    taken.clear()
    taken += [1] * 5
    assert main(["train", str(out), "--restart", *QUICK]) == 0
    assert len(taken) == 5 + 16  # every step was taken again
    assert (out.read_bytes(), out.with_suffix(".json").read_bytes()) == (whole, record)


def test_identify_takes_weights_for_the_networks_only(tmp_path, capsys):
    from identification.datasets import measured_campaign
    from tunnel_sim.files.campaign_folder import write_campaign

    write_campaign(measured_campaign("rotary-pendulum"), tmp_path / "c")
    shipped = ["--weights", str(tmp_path / "none.safetensors")]
    assert main(["identify", str(tmp_path / "c"), *shipped]) == 2
    assert "has no weights" in capsys.readouterr().err
    assert main(["identify", str(tmp_path / "c"), "-e", "neural_network", *shipped]) == 2
    assert "no such file" in capsys.readouterr().err
