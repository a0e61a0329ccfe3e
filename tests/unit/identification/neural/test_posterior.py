"""The network in NumPy and in torch, its training in parts, and its files."""

import hashlib
import json

import numpy as np
import pytest

from identification.neural.posterior import TrainedPosterior, forward, to_bytes, trained_of
from tunnel_lab.experiments.training import (
    INPUTS,
    ShardedTraining,
    contexts,
    fit,
    judged,
    losses,
    start_state,
)
from tunnel_reference.forms import FAMILIES
from tunnel_sim.vocabulary.errors import TunnelError

RIVALS, FEATURES, RUNS, QUANTITIES = 9, 8, 6, 2


def made_up(count=300, seed=1):
    """Samples in which rival 3 is right where it is significant, and rival 5, more significant still, never is."""
    rng = np.random.default_rng(seed)
    shifts = 5.0 * rng.standard_normal((count, RIVALS, QUANTITIES))
    shifts[:, 0] = 0.0
    scores = rng.standard_normal((count, RIVALS))
    acting = rng.random(count) < 0.5
    scores[acting, 3] += 30.0
    scores[acting, 5] += 60.0
    rivals = rng.standard_normal((count, RIVALS, FEATURES))
    rivals[..., 0], rivals[..., 3] = np.arcsinh(scores), 0.0
    runs = np.concatenate((rng.standard_normal((count, 4, RUNS)), np.ones((count, 4, 1))), axis=-1)
    runs[: count // 2, 2:] = 0.0
    target = rng.standard_normal((count, QUANTITIES)) + acting[:, None] * shifts[:, 3]
    labels = np.zeros((count, len(FAMILIES)))
    labels[:, 0] = acting
    return {
        "rivals": rivals,
        "runs": runs,
        "shifts": shifts,
        "widths": np.ones((count, RIVALS, QUANTITIES)),
        "valid": np.ones((count, RIVALS)),
        "known": np.ones((count, QUANTITIES)),
        "target": target,
        "labels": labels,
    }


@pytest.fixture(scope="module")
def fitted():
    samples, spec = made_up(), ShardedTraining(seed=3, steps=60)
    return samples, spec, fit(samples, spec, start_state(samples, spec))


def test_torch_and_numpy_agree(fitted):
    import torch

    samples, _, state = fitted
    single = {name: torch.from_numpy(np.asarray(value, np.float32)) for name, value in state.weights.items()}
    batch = {name: torch.from_numpy(np.asarray(value, np.float32)) for name, value in samples.items()}
    for one, other in zip(losses(np, state.weights, samples), losses(torch, single, batch), strict=True):
        assert float(one) == pytest.approx(float(other), rel=1e-4)


def test_training_lowers_the_loss_on_samples_apart(fitted):
    samples, spec, state = fitted
    apart = made_up(200, seed=2)
    before = losses(np, start_state(samples, spec).weights, apart)
    after = losses(np, state.weights, apart)
    assert after[0] < before[0]
    assert after[1] < before[1]


def test_a_training_in_parts_gives_the_same_bits(fitted):
    samples, spec, state = fitted
    half = fit(samples, spec, start_state(samples, spec), until=25)
    assert half.step == 25
    whole = fit(samples, spec, half)
    for name, value in state.weights.items():
        np.testing.assert_array_equal(whole.weights[name], value)


def test_order_and_padding_of_runs_do_not_matter(fitted):
    samples, _, state = fitted
    turned = dict(samples)
    turned["runs"] = np.concatenate((samples["runs"][:, ::-1], np.zeros((300, 2, RUNS + 1))), axis=1)
    one, other = (forward(np, state.weights, *(s[name] for name in INPUTS)) for s in (samples, turned))
    np.testing.assert_allclose(other.means, one.means, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(other.logarithms, one.logarithms, rtol=1e-6, atol=1e-6)


def test_the_threshold_has_its_false_alarm_rate(fitted):
    samples, _, state = fitted
    trained = judged(state.weights, samples, made_up(1000, seed=4))
    again = trained.distance(contexts(state.weights, made_up(2000, seed=5))) > trained.threshold
    assert 0.0 < again.mean() < 0.03  # one in a hundred; the threshold itself is known to a third of that
    strange = made_up(50, seed=6)
    strange["runs"][..., :-1] *= 30.0
    assert np.mean(trained.distance(contexts(state.weights, strange)) > trained.threshold) > 0.9


def test_files_are_read_back_and_checked(fitted):
    samples, _, state = fitted
    one = judged(state.weights, samples, samples)
    content = to_bytes({"record": one, "campaign": one})
    sizes = dict(rivals=RIVALS, features=FEATURES, runs=RUNS, quantities=QUANTITIES, effects=len(FAMILIES))
    record = {
        "weights_sha256": hashlib.sha256(content).hexdigest(),
        "effects": list(FAMILIES),
        "networks": {kind: {"sizes": sizes, "threshold": one.threshold} for kind in ("record", "campaign")},
    }
    found = trained_of(content, json.dumps(record).encode(), "here")
    assert isinstance(found["record"], TrainedPosterior)
    np.testing.assert_allclose(
        contexts(found["record"].weights, samples), contexts(one.weights, samples), rtol=1e-5
    )
    with pytest.raises(TunnelError, match="do not belong together"):
        trained_of(content + b" ", json.dumps(record).encode(), "here")
    sizes["runs"] += 1
    with pytest.raises(TunnelError, match="not the weights"):
        trained_of(content, json.dumps(record).encode(), "here")
