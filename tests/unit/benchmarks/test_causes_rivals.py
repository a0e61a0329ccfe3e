"""Evidence beside a model's error, and the neural classifier. Truth: dense normal laws, symmetries, toy data."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from benchmarks.causes import neural_training
from benchmarks.causes.discrepancy import ETA, Discrepancy, ErrorEvidence, Linear
from benchmarks.causes.methods.discrepancy_evidence import LEFT, ODDS, SCALE, weigh
from benchmarks.causes.neural_network import LABELS, Classifier, read_classifier
from benchmarks.causes.neural_training import (
    NetworkSetting,
    TrainingCampaigns,
    make_campaigns,
    read_samples,
    trained,
)
from benchmarks.causes.summaries import mirrored, summaries
from tests.reference.rigs import short_campaigns
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.fixture(scope="module")
def training(tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    with short_campaigns():
        seconds = make_campaigns(folder, 2, chunk=1)
    return folder, seconds


def test_the_evidence_is_that_of_the_dense_normal_law():
    rng = np.random.default_rng(0)
    rows = 40
    slopes, basis, residual = (rng.standard_normal((rows, k)) for k in (3, 5, 1))
    nominal = np.array([True, True, False])
    given = Linear(residual[:, 0], slopes, nominal, np.array([1.0, 1.0, 2.0]))
    error = Discrepancy([], 7.0, np.array([2.0, 0.5]), basis)
    found = error.evidence(given)
    # the cause's response beside the nominal parameters has the power of the gap, half of it in a run of two
    unit = np.linalg.qr(slopes[:, :2])[0]
    beside = slopes[:, 2] - unit @ (unit.T @ slopes[:, 2])
    prior = np.diag([4.0, 0.25, 7.0 / (2.0 * float(beside @ beside))])
    for eta, log in zip(ETA, found.log, strict=True):
        covariance = np.eye(rows) + slopes @ prior @ slopes.T + eta**2 * basis @ basis.T
        truth = multivariate_normal(np.zeros(rows), covariance).logpdf(residual[:, 0])
        assert log == pytest.approx(truth + 0.5 * rows * np.log(2.0 * np.pi), abs=1e-6)
    assert found.error_share[0] < 1e-4


def test_weights_are_evidences_times_prior_odds_and_large_errors_are_unknown():
    hyper = 1.0 / (1.0 + (ETA / SCALE) ** 2) * ETA
    hyper /= hyper.sum()
    small, large = np.zeros(ETA.size), np.where(ETA > 0.3, 1.0, 0.0)
    flat = np.zeros(ETA.size)
    found = weigh(
        ErrorEvidence(flat - 50.0, small, 0.0, 0.0),
        {
            ("a",): ErrorEvidence(flat, large, 0.0, 0.0),
            ("a", "b"): ErrorEvidence(flat + np.log(3.0), small, 20.0, -1.0),
        },
        {("a", "b", "c"): (ErrorEvidence(flat, small, 20.0, -1.0), 16.0)},
    )
    inside = float(hyper[large <= LEFT].sum())
    weights = {
        ("a",): inside,
        ("unknown",): 1.0 - inside,
        ("a", "b"): 3.0 * ODDS,
        ("a", "b", "c"): np.exp(-0.5 * (20.0 - 16.0) - 1.0 - 9.0) * ODDS**2,
    }
    total = sum(weights.values())
    assert found == pytest.approx({names: w / total for names, w in weights.items()}, rel=1e-6)


@pytest.mark.slow
def test_the_evidence_answers_a_campaign_with_one_cause(training):
    """The nominal model's evidence is less than that of the cause which acts, by far more than the prior odds."""
    from benchmarks.causes.discrepancy import linear
    from benchmarks.causes.fits import nominal

    folder, _ = training
    name, truth = truths_of(folder)[0]
    start, _, detected = nominal(folder / "campaigns" / name)
    assert detected == bool(truth["effects"])
    error = Discrepancy.of(start.fit)
    alone = error.evidence(linear(start.fit, error.along))
    assert error.basis.shape[0] == sum(p.residual.size for p in error.along)
    # an error of the model as large as the gap explains it better than none
    assert not detected or alone.log.max() > alone.log[0] + 10.0


def truths_of(folder):
    found = {}
    for path in sorted((folder / "truths").glob("*.json")):
        found |= json.loads(path.read_text())["truths"]
    return sorted(found.items())


def test_training_campaigns_are_made_once_and_are_not_those_of_the_benchmark(training, monkeypatch):
    folder, seconds = training
    assert neural_training.TRAINING_SEED != neural_training.SEED
    monkeypatch.setattr("tunnel_reference.severity.size_separably", lambda _draws: 1 / 0)
    assert make_campaigns(folder, 2, chunk=1) == pytest.approx(seconds)
    samples = read_samples(folder)
    assert len(samples.whole) == len(truths_of(folder))
    for (_, truth), acts in zip(truths_of(folder), samples.acts, strict=True):
        assert {n for n, a in zip(LABELS, acts, strict=True) if a} == set(truth["effects"])


def test_the_statistics_of_a_mirrored_campaign_are_the_mirrored_statistics(training):
    folder, _ = training
    campaign = read_campaign(folder / "campaigns" / truths_of(folder)[0][0])
    other = replace(
        campaign,
        runs=tuple(replace(r, record=replace(r.record, yaw_rad=-r.record.yaw_rad)) for r in campaign.runs),
    )
    (runs, whole), (other_runs, other_whole) = summaries(campaign), summaries(other)
    assert not np.allclose(runs, other_runs)
    np.testing.assert_allclose(other_runs, mirrored(runs), atol=1e-6)
    np.testing.assert_allclose(other_whole, whole, atol=1e-6)


@pytest.mark.slow
def test_the_network_learns_a_label_and_is_read_back(tmp_path):
    """The first label acts where the mean of one statistic over the runs is positive."""
    rng = np.random.default_rng(1)
    count, most = 300, 3
    runs = rng.standard_normal((count, most, 88))
    there = np.ones((count, most))
    there[::2, 2] = 0.0
    runs *= there[:, :, None]
    runs[:, :, 80] += 2.0 * rng.choice([-1.0, 1.0], (count, 1)) * there
    acts = np.zeros((count, len(LABELS)))
    acts[:, 0] = runs[:, :, 80].sum(axis=1) > 0.0
    asked = np.zeros_like(acts)
    asked[:, 0] = 1.0
    samples = TrainingCampaigns(runs, there, rng.standard_normal((count, 4)), acts, asked)
    found = trained(samples, 5, [NetworkSetting(16, 1e-2, 0.1)], epochs=25)
    assert found.facts["held_out"] < 0.5  # nats; 0.7 without the statistic
    replace(found, facts=found.facts | {"simulation_s": 1.0}).save(tmp_path / "w.safetensors")
    again = read_classifier(tmp_path / "w.safetensors")
    assert again.facts["campaigns"] == count
    one, whole = np.zeros((2, 88)), np.zeros(4)
    for sign in (-1.0, 1.0):
        one[:, 80] = sign * 6.0
        p = again.probabilities(one, whole)
        assert p == pytest.approx(found.probabilities(one, whole), abs=1e-5)
        assert (p[LABELS[0]] > 0.5) == (sign > 0.0)
        assert again.probabilities(one[::-1], whole) == pytest.approx(p)
    assert isinstance(again, Classifier)
    (tmp_path / "bad.safetensors").write_bytes(b"no")
    with pytest.raises(TunnelError, match="not a trained classifier"):
        read_classifier(tmp_path / "bad.safetensors")


@pytest.mark.parametrize(
    "given", [["few", "--campaigns", "0"], ["file"], ["new", "--out", "nowhere/w.safetensors"]]
)
def test_training_refuses_bad_input_in_one_line_and_writes_nothing(tmp_path, monkeypatch, capsys, given):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert neural_training.main(given) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
