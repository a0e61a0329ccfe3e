"""``tunnel train --estimator neural_posterior`` on a few short campaigns: resumed work and the same bits."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.estimators.neural_posterior import NeuralPosterior
from tests.reference.free_decays import TWELVE, campaign
from tests.reference.rigs import rig
from tunnel_lab.cli import main
from tunnel_reference.catalogue import Group
from tunnel_reference.forms import FORMS

WORDS = ["-e", "neural_posterior", "--shards", "1", "--steps", "4", "--jobs", "0"]


@pytest.fixture
def small(monkeypatch):
    """Two campaigns of three seconds in a shard, and typical sizes of the effects."""
    from tunnel_lab.experiments import training, training_samples

    sizes = {training_samples.label(form): form.start for form in FORMS if form.group is not Group.RARE}
    monkeypatch.setattr(training, "sizes_at_unit_excess", lambda _seed: sizes)
    monkeypatch.setattr(training_samples, "CAMPAIGNS", 2)
    monkeypatch.setattr(training_samples, "DURATION", 4.0)
    monkeypatch.setattr(training, "_KEPT_EVERY", 2)
    return training


@pytest.mark.slow
def test_interrupted_training_gives_the_same_bits_and_its_weights_are_used(
    small, tmp_path, monkeypatch, capsys
):
    whole, out = tmp_path / "whole.safetensors", tmp_path / "w.safetensors"
    assert main(["train", str(whole), *WORDS]) == 0
    steps = small.fit

    def interrupted(samples, spec, state, **named):
        if state.step == 2:
            raise KeyboardInterrupt
        return steps(samples, spec, state, **named)

    monkeypatch.setattr(small, "fit", interrupted)
    assert main(["train", str(out), *WORDS]) == 130
    assert not out.exists()
    monkeypatch.setattr(small, "fit", steps)
    assert main(["train", str(out), "--seed", "2", *WORDS]) == 2
    assert "--restart" in capsys.readouterr().err
    assert main(["train", str(out), *WORDS]) == 0
    assert out.read_bytes() == whole.read_bytes()
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [
        ".json",
        ".json",
        ".safetensors",
        ".safetensors",
    ]
    record = json.loads(out.with_suffix(".json").read_text())
    assert record["networks"]["campaign"]["samples"]["training"] >= 2
    found = identify(
        campaign(TWELVE[:4], noise=5e-4, rng=np.random.default_rng(1)), NeuralPosterior(out), throw=False
    )
    assert found.estimator == "neural_posterior"


def test_rare_and_outside_forms_are_never_drawn():
    from tunnel_lab.experiments.training_samples import draw_for_training, label

    sizes = {label(form): form.start for form in FORMS if form.group is not Group.RARE}
    drawn = [draw_for_training(np.random.default_rng(seed), sizes) for seed in range(60)]
    forms = {effect.form for one in drawn for effect in one.effects}
    assert len(forms) > 20
    assert all(form.group is not Group.RARE and form.family != "unknown" for form in forms)


def test_variants_of_a_campaign_lose_runs_and_ends_and_differ_in_noise(monkeypatch):
    from tunnel_lab.experiments import training_samples

    monkeypatch.setattr(training_samples, "CAMPAIGNS", 8)
    monkeypatch.setattr(training_samples, "DURATION", 2.0)
    sizes = {training_samples.label(form): form.start for form in FORMS if form.group is not Group.RARE}
    made = list(
        training_samples.readings_of(training_samples.ShardSpec(1, "tuning", 0, tuple(sizes.items())))
    )
    fewer = shorter = 0
    for first in range(0, len(made), training_samples.VARIANTS):
        (whole, drawn, families, _), *others = made[first : first + training_samples.VARIANTS]
        assert [number for *_, number in made[first : first + training_samples.VARIANTS]] == [0, 1, 2]
        names = [run.id for run in whole.runs]
        assert {run.record.time_s.size for run in whole.runs} == {500}  # 2 s at 250 Hz
        for one, read, of, _ in others:
            kept = [run.id for run in one.runs]
            assert kept == [name for name in names if name in kept]  # in their order, and none of them twice
            (size,) = {run.record.time_s.size for run in one.runs}
            assert 200 <= size <= 500
            assert 0.3 <= read.noise_std / drawn.noise_std <= 8.0
            assert (training_samples.truth_of(read), of) == (training_samples.truth_of(drawn), families)
            fewer += len(kept) < len(names)
            shorter += size < 500
    # One in two each, but for a draw of all runs: of 16, none or all would be 1 in 65 000.
    assert 0 < fewer < 16
    assert 0 < shorter < 16


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_size_of_an_effect_that_diverges_is_moved_towards_its_usual_size(factor):

    from tunnel_lab.experiments.training_samples import nearer
    from tunnel_reference.draw import Mixture, draw_campaign

    drawn = draw_campaign(np.random.default_rng(1), kind="single", mixture=Mixture(rare=0.0))
    effect = replace(drawn.effects[0], value=factor * drawn.effects[0].form.start)
    moved = nearer(replace(drawn, effects=(effect,)), np.inf).effects[0].value
    assert abs(np.log(moved / effect.form.start)) < abs(np.log(factor))


def test_the_flexible_rod_moves_as_the_reference_integrator_says():

    from tunnel_lab.experiments.training_samples import flexible_motion
    from tunnel_reference.draw import draw_conditions, with_defaults
    from tunnel_reference.integrator import integrate
    from tunnel_reference.true_conditions import TwistingRod

    stated = with_defaults(replace(draw_conditions(np.random.default_rng(1)), duration=0.3))
    for held in (True, False):
        c = replace(stated, rod=TwistingRod(1e-4, 0.15, 0.01, 0.0, held))
        exact, stepped = flexible_motion(c), integrate([c], [[]], substeps=20)[0]
        assert np.abs(exact.angle - stepped.angle).max() < 1e-7
        assert np.abs(exact.rate - stepped.rate).max() < 1e-4


def test_white_noise_tells_as_much_at_the_rate_of_training():
    """Its power per hertz is the same; coloured noise, far below either rate, keeps its level."""
    from tunnel_lab.experiments.training_samples import SAMPLE_RATE, at_low_rate

    fast = rig(sample_rate=1000.0, noise_std=3e-3, coloured_share=0.25)
    slow = at_low_rate(fast)
    assert slow.sample_rate == SAMPLE_RATE

    def parts(c):
        return (1.0 - c.coloured_share) * c.noise_std**2 / c.sample_rate, c.coloured_share * c.noise_std**2

    assert parts(slow) == pytest.approx(parts(fast))
