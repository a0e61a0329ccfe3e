"""Levenberg–Marquardt, the evidence and what ships, each against something independent."""

import hashlib
import json
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from identification.neural.networks import (
    DAMPING,
    FREQUENCY,
    SIZES,
    DataSpec,
    held_out_errors,
    networks_of,
    parameter_count,
    shipped_networks,
    shipped_record,
    training_pairs,
)
from identification.neural.three_cycles import network_inputs, response_points
from identification.neural.train import (
    Checkpoint,
    Hyperparameters,
    TrainingPairs,
    TrainingProgress,
    TrainingSpec,
    advance_training,
    first_weights,
    log_evidence,
    one_thread,
    outputs_and_jacobian,
    train,
    updated_hyperparameters,
)
from tunnel_sim.vocabulary.errors import TunnelError

SHORT = TrainingSpec(seed=5, data=DataSpec(zeta_count=40, grid=(5, 9), test_count=50), starts=2,
                     damping_steps=6, frequency_steps=8)  # fmt: skip


@pytest.mark.parametrize("sizes", [(100, 5, 5, 1), (2, 2, 5, 1)])
def test_jacobian_is_that_of_automatic_differentiation(sizes):
    import torch

    rng = np.random.default_rng(0)
    weights = torch.from_numpy(first_weights(sizes, rng))
    inputs = torch.from_numpy(rng.standard_normal((4, sizes[0])))
    outputs, jacobian = outputs_and_jacobian(weights, sizes, inputs)
    assert jacobian.shape == (4, parameter_count(sizes))
    expected = torch.autograd.functional.jacobian(
        lambda moved: outputs_and_jacobian(moved, sizes, inputs)[0], weights
    )
    np.testing.assert_allclose(jacobian.numpy(), expected.numpy(), rtol=1e-12, atol=1e-14)
    assert float(outputs.std()) > 0.0


def test_the_layer_counts_are_the_papers():
    assert SIZES == {"damping": (100, 5, 5, 1), "frequency": (2, 2, 5, 1)}
    assert parameter_count(SIZES[DAMPING]) == 100 * 5 + 5 + 5 * 5 + 5 + 5 + 1


def linear_gaussian():
    rng = np.random.default_rng(3)
    design = rng.standard_normal((60, 7)) * np.geomspace(1.0, 0.01, 7)
    return design, design @ rng.standard_normal(7) + 0.05 * rng.standard_normal(60)


def optimum(design, targets, held):
    # Of β Σe² + α Σw², in closed form.
    normal = held.beta * design.T @ design + held.alpha * np.eye(design.shape[1])
    weights = np.linalg.solve(normal, held.beta * design.T @ targets)
    errors = design @ weights - targets
    return float(errors @ errors), float(weights @ weights)


def marginal(design, targets, held):
    # ln p(targets | α, β) exactly: variances 1/(2α) of the weights and 1/(2β) of the errors.
    covariance = design @ design.T / (2.0 * held.alpha) + np.eye(targets.size) / (2.0 * held.beta)
    return multivariate_normal(np.zeros(targets.size), covariance).logpdf(targets)


def test_the_evidence_is_exact_for_a_linear_gaussian_model():
    design, targets = linear_gaussian()
    eigenvalues = np.linalg.svd(design, compute_uv=False) ** 2
    for held in (Hyperparameters(0.5, 200.0), Hyperparameters(3.0, 20.0)):
        found = log_evidence(held, eigenvalues, *optimum(design, targets, held), (60, 7))
        assert found == pytest.approx(marginal(design, targets, held), rel=1e-10)


def test_the_updates_end_where_the_exact_marginal_likelihood_is_largest():
    design, targets = linear_gaussian()
    eigenvalues = np.linalg.svd(design, compute_uv=False) ** 2
    held = Hyperparameters(0.01, 1.0)
    for _ in range(500):
        held = updated_hyperparameters(held, eigenvalues, *optimum(design, targets, held), 60)
    best = minimize(
        lambda x: -marginal(design, targets, Hyperparameters(*np.exp(x))),
        np.log([held.alpha, held.beta]) + 0.3,
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10},
    )
    np.testing.assert_allclose([held.alpha, held.beta], np.exp(best.x), rtol=1e-4)
    assert 0.0 < held.effective_parameters(eigenvalues) < 7.0
    assert 1.0 / np.sqrt(2.0 * held.beta) == pytest.approx(0.05, rel=0.3)


@pytest.fixture(autouse=True)
def quiet_torch():
    with one_thread():
        yield


def test_the_weight_of_the_errors_stays_above_zero_where_every_pair_is_used_up():
    """As many pairs as directions, a prior far below: N − γ is below the rounding error of N."""
    new = updated_hyperparameters(Hyperparameters(1e-20, 1.0), np.ones(8), 1e-3, 1.0, 8)
    assert new.beta > 0.0
    assert np.isfinite(log_evidence(new, np.ones(8), 1e-3, 1.0, (8, 541)))


def test_every_step_lowers_the_cost_it_was_taken_for():
    problem = TrainingPairs.of(training_pairs(SHORT.data, DAMPING), SIZES[DAMPING], unit_deviation=False)
    progress = TrainingProgress(first_weights(problem.sizes, np.random.default_rng(1)))

    def cost(weights, held):
        import torch

        outputs = outputs_and_jacobian(
            torch.from_numpy(weights), problem.sizes, torch.from_numpy(problem.inputs)
        )[0]
        errors = outputs.numpy() - problem.targets
        return held.beta * errors @ errors + held.alpha * weights @ weights

    for _ in range(5):
        after = advance_training(progress, problem)
        assert cost(after.weights, after.held) < cost(progress.weights, after.held)
        progress = after
    assert progress.iteration == 5


def test_a_short_training_repeats_to_the_bit_and_another_seed_does_not():
    first, second = train(SHORT), train(SHORT)
    assert first.weights == second.weights
    assert first.record == second.record
    assert train(replace(SHORT, seed=6)).weights != first.weights


def test_the_progress_is_the_work_done_of_all_work():
    seen = []
    train(SHORT, progress=lambda done, _text: seen.append(done))
    steps = [SHORT.work(which) for which in (DAMPING, FREQUENCY) for _ in range(2 * SHORT.steps(which))]
    assert sorted(set(seen)) == np.cumsum(steps).tolist()
    assert seen == sorted(seen)
    assert seen[-1] == SHORT.total_work


def test_the_record_says_why_each_training_stopped():
    kept = []
    train(SHORT, keep=kept.append)
    stuck = next(held for held in kept if len(held.ended) == 1 and held.running is not None)
    stuck = replace(stuck, running=replace(stuck.running, finished=True))
    starts = [
        start for net in train(SHORT, resume=stuck).record["networks"].values() for start in net["starts"]
    ]
    said = [(start["stopped_because"], start["steps"]) for start in starts]
    whole = [("all steps taken", SHORT.steps(which)) for which in (DAMPING, FREQUENCY) for _ in range(2)]
    assert said == [whole[0], ("no step lowers F", 1), *whole[2:]]


@pytest.mark.parametrize("stop", [3, 6, 15, 27])
def test_an_interrupted_training_goes_on_to_the_same_bits(stop):
    class Stop(Exception):
        pass

    kept = []

    def keep(checkpoint):
        kept.append(checkpoint)
        if len(kept) == stop:
            raise Stop

    with pytest.raises(Stop):
        train(SHORT, keep=keep)
    spec = SHORT.to_json_dict()
    content = kept[-1].to_bytes(spec)
    again = Checkpoint.from_bytes(content, spec)
    assert again is not None
    assert train(SHORT, resume=again).weights == train(SHORT).weights
    assert Checkpoint.from_bytes(content, replace(SHORT, seed=6).to_json_dict()) is None
    assert Checkpoint.from_bytes(content[:-8], spec) is None


def test_shipped_weights_are_what_their_record_says():
    record, networks = shipped_record(), shipped_networks()
    content = (resources.files("identification") / "neural" / "weights" / "paper.safetensors").read_bytes()
    assert hashlib.sha256(content).hexdigest() == record["weights_sha256"]
    # As tunnel train trains by default, so that anyone can make them again.
    seen = json.loads(json.dumps(TrainingSpec().to_json_dict()))
    assert {name: record[name] for name in seen} == seen
    assert networks.spec == TrainingSpec().data
    # The errors again, on the same responses and on others.
    same = held_out_errors(networks, np.random.default_rng([record["seed"], 2]))
    for name, value in record["errors"].items():
        assert getattr(same, name) == pytest.approx(value, rel=1e-4)
    other = held_out_errors(networks, np.random.default_rng(99))
    assert other.zeta < 1.5 * record["errors"]["zeta"]
    assert other.omega_relative < 1.5 * record["errors"]["omega_relative"]
    for which, size in SIZES.items():
        assert record["networks"][which]["sizes"] == list(size)
        for start in record["networks"][which]["starts"]:
            assert 0.0 < start["effective_parameters"] < record["networks"][which]["parameters"]
    assert {"torch", "numpy", "safetensors", "virtual-wind-tunnel"} <= set(record["versions"])


def test_weights_with_another_record_are_refused():
    content = (resources.files("identification") / "neural" / "weights" / "paper.safetensors").read_bytes()
    text = (resources.files("identification") / "neural" / "weights" / "paper.json").read_text()
    with pytest.raises(TunnelError, match="do not belong together"):
        networks_of(content + b" ", text, "here")
    with pytest.raises(TunnelError, match="not the weights"):
        networks_of(content, "{}", "here")


def test_numpy_and_torch_agree_on_the_shipped_networks():
    import torch

    networks = shipped_networks()
    zeta = np.geomspace(*networks.spec.zeta_range, 50)
    for network, rows in (
        (networks.damping, network_inputs(zeta)),
        (networks.frequency, np.column_stack((zeta, np.linspace(-0.3, 3.9, 50)))),
    ):
        outputs, jacobian = outputs_and_jacobian(
            torch.from_numpy(network.weights), network.sizes, torch.from_numpy(network.inputs.apply(rows))
        )
        scale, offset = network.output.deviation[0], network.output.mean[0]
        np.testing.assert_allclose(network.value(rows), outputs.numpy() * scale + offset, rtol=0, atol=1e-12)
        moved = torch.from_numpy(rows[7]).requires_grad_()
        scaled = (moved - torch.tensor(network.inputs.mean, dtype=torch.float64)) / torch.tensor(
            network.inputs.deviation, dtype=torch.float64
        )
        value = (
            outputs_and_jacobian(torch.from_numpy(network.weights), network.sizes, scaled[None])[0][0] * scale
        )
        value.backward()
        np.testing.assert_allclose(network.input_gradient(rows[7]), moved.grad.numpy(), rtol=1e-9, atol=1e-12)
        # The posterior from its few directions, against the whole matrix.
        start = next(s for s in starts_of(network) if s["chosen"])
        pairs = network.inputs.apply(training_pairs(networks.spec, start["which"])[0])
        whole = outputs_and_jacobian(
            torch.from_numpy(network.weights), network.sizes, torch.from_numpy(pairs)
        )[1]
        singular, right = np.linalg.svd(whole.numpy(), full_matrices=False)[1:]
        row = jacobian.numpy()[7]
        along = right @ row
        rest = row - right.T @ along
        variance = np.sum(along**2 / (2.0 * (start["beta"] * singular**2 + start["alpha"])))
        variance += rest @ rest / (2.0 * start["alpha"])
        assert network.posterior_std(rows[7]) == pytest.approx(np.sqrt(variance) * scale, rel=1e-3)


def starts_of(network):
    record = shipped_record()["networks"]
    which = next(name for name, sizes in SIZES.items() if sizes == network.sizes)
    chosen = record[which]["chosen_start"]
    return [
        {**start, "which": which, "chosen": number == chosen}
        for number, start in enumerate(record[which]["starts"], 1)
    ]


def test_points_are_means_of_the_impulse_response():
    zeta, fine = 0.07, (np.arange(200_000) + 0.5) / 200_000
    pole = 6.0 * np.pi * zeta / np.sqrt(1.0 - zeta**2)
    curve = np.exp(-pole * fine) * np.sin(6.0 * np.pi * fine)
    expected = curve.reshape(100, -1).mean(axis=1)
    np.testing.assert_allclose(response_points(np.array([zeta]))[0], expected, atol=1e-9)
