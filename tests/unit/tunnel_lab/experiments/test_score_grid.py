"""Grids, trials and the work on them: what is refused, what is the same, what is kept."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.scoring import score
from tests.reference.free_decays import damped_cosine
from tunnel_lab.experiments import score as score_trials
from tunnel_lab.experiments.runner import processes
from tunnel_lab.experiments.score import read_trials, write_trials
from tunnel_lab.experiments.score_grid import Cell, Grid, draw_trial, effects_of, load_grid, packaged_grid
from tunnel_lab.experiments.score_view import scores_frame
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import Truth

HEAD = 'schema_version = 1\nname = "g"\nseed = 1\ntrials = 4\n'
DECAYS = "[[decays]]\nzeta = [0.01, 0.05]\nfrequency = [2.0]\nnoise = [0.01]\nduration = [4.0]\n"
CAMPAIGNS = "[[campaigns]]\nsprings = [16.12]\nwind_speeds = [25.0]\nnoise = [0.0015]\nduration = [4.0]\n"
DECAY = Cell("decay", 0.01, 4.0, 0.35, 500.0, 0.0, zeta=0.02, frequency=2.0)
NAMES = ("conventional",)


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(
        HEAD + DECAYS + CAMPAIGNS + 'effects = ["none", "coulomb_friction:friction_moment=0.002"]\n'
    )
    return load_grid(path)


def test_every_combination_is_a_cell(small):
    assert [cell.kind for cell in small.cells] == ["decay", "decay", "campaign", "campaign"]
    assert len({cell.label for cell in small.cells}) == 4
    assert Grid.from_json_dict(json.loads(json.dumps(small.to_json_dict()))) == small
    assert len(packaged_grid().cells) > 10


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (HEAD, ["no cells", "[[decays]]"]),
        (HEAD + DECAYS + DECAYS, ["twice"]),
        (HEAD + DECAYS.replace("0.01, 0.05", "1.5"), ["zeta", "between 0 and 1"]),
        (HEAD + DECAYS + "colour = 1\n", ["unknown key 'colour'"]),
        (HEAD + "trials_of = { conventionl = 3 }\n" + DECAYS, ["conventionl", "did you mean 'conventional'"]),
        (HEAD + CAMPAIGNS + 'effects = ["coulomb_frction:x=1"]\n', ["did you mean 'coulomb_friction'"]),
        (HEAD + CAMPAIGNS + 'effects = ["coulomb_friction"]\n', ["does nothing", "severity"]),
        (HEAD + CAMPAIGNS + 'effects = ["damping_scatter:spread=0.1 + damping_scatter:spread=0.1"]\n',
         ["damping_scatter is given twice", "give it once"]),
        (DECAYS, ["schema_version"]),
    ],
)  # fmt: skip
def test_bad_grids_are_refused_in_a_line(tmp_path, text, parts):
    path = tmp_path / "grid.toml"
    path.write_text(text)
    with pytest.raises(TunnelError) as error:
        load_grid(path)
    for part in (str(path), *parts):
        assert part in str(error.value)


def test_a_decay_is_the_textbooks_with_the_noise_that_is_said():
    trial = draw_trial(DECAY, 1, 0)
    run = trial.campaign.runs[0]
    zeta, omega = trial.truth["zeta"], trial.truth["omega_n"]
    textbook = damped_cosine(run.record.time_s, 2.0 * zeta * omega, omega**2, 0.35, 0.0)
    left = run.record.yaw_rad - textbook
    assert left.std() == pytest.approx(0.0035, rel=0.07)  # 2000 samples: 4.4σ
    assert abs(left.mean()) < 0.02
    assert (run.spring_stiffness, trial.campaign.sensor.noise_std) == (None, None)


def test_a_trial_hangs_on_its_seed_cell_and_number_only():
    first, same = draw_trial(DECAY, 1, 3), draw_trial(DECAY, 1, 3)
    np.testing.assert_array_equal(first.campaign.runs[0].record.yaw_rad, same.campaign.runs[0].record.yaw_rad)
    others = (draw_trial(DECAY, 2, 3), draw_trial(DECAY, 1, 4), draw_trial(replace(DECAY, zeta=0.03), 1, 3))
    for other in others:
        assert other.truth["omega_n"] != first.truth["omega_n"]


def test_the_bound_is_that_of_the_start_actually_released():
    from identification.uncertainty.cramer_rao import campaign_bound

    cell = Cell("campaign", 0.0015, 4.0, 0.35, 500.0, 0.0, wind_speed=25.0, springs=(16.12, 44.84))
    trial = draw_trial(cell, 1, 0)
    nominal = campaign_bound(trial.campaign, Truth(**trial.truth), noise_std=0.0015 * 0.35)
    for name, bound in trial.bound.items():
        assert bound != nominal.std(name)
        assert bound == pytest.approx(nominal.std(name), rel=0.12)  # releases scatter by 3 %


def test_slow_methods_see_the_first_trials(small):
    results, _ = score_trials.score_grid(
        replace(small, trials_of=(("conventional", 2),)), NAMES, processes(0)
    )
    assert set(results.table["trial"]) == {0, 1}


def test_trials_survive_the_disk(small, tmp_path):
    results, _ = score_trials.score_grid(small, NAMES, processes(0))
    again = read_trials(write_trials(tmp_path / "trials.parquet", results))
    assert again.table.equals(results.table)
    assert (again.grid, again.estimators) == (small, NAMES)
    frame = scores_frame(results)
    assert frame.height == 2 * 2 + 2 * 4
    for row, trials in zip(frame.iter_rows(named=True), results.trials.values(), strict=True):
        judged = score(trials)
        figures = {**vars(judged), "relative_bias_percent": judged.relative_bias}
        for name in ("bias", "relative_bias_percent", "bias_in_stds", "rmse", "rmse_over_bound"):
            figure = figures[name]
            wanted = (None, None) if figure is None else (figure.value, figure.std)
            assert (row[name], row[f"{name}_std_error"]) == wanted
    for name, kind in (("zeta", "decay"), ("frequency_hz", "decay"), ("wind_speed_m_per_s", "campaign")):
        assert (frame[name].is_not_null() == (frame["kind"] == kind)).all()  # what a cell has not is left out
    assert frame["coverage_low"].is_between(0.0, 1.0).all()


@pytest.mark.parametrize("content", [b"", b"not parquet"])
def test_a_file_that_is_no_baseline_is_refused(tmp_path, content):
    path = tmp_path / "b.parquet"
    path.write_bytes(content)
    with pytest.raises(TunnelError, match="not a readable Parquet file"):
        read_trials(path)
    with pytest.raises(TunnelError, match="no such file"):
        read_trials(tmp_path / "none.parquet")


def test_runs_of_a_cell_may_scatter_in_several_numbers(tmp_path):
    """Truth: the order of the vocabulary, and that ωn scatters half as much as the spring."""
    text = "damping_scatter:spread=0.1 + stiffness_scatter:spread=0.01"
    path = tmp_path / "grid.toml"
    path.write_text(HEAD + CAMPAIGNS + f'effects = ["none", "{text}"]\n')
    grid = load_grid(path)
    plain, scattering = (cell for cell in grid.cells if cell.noise == grid.cells[0].noise)
    assert [effect.name for effect in effects_of(scattering.effect)] == [
        "stiffness_scatter",
        "damping_scatter",
    ]
    assert effects_of(plain.effect) == ()
    assert Grid.from_json_dict(grid.to_json_dict()) == grid

    def spread(cell):
        """Of ωn with the wind off about that of the stated spring, relative."""
        found = []
        for trial in (draw_trial(cell, 1, number) for number in range(12)):
            omega = identify(replace(trial.campaign, runs=trial.campaign.runs[:1])).runs[0].omega_n
            found.append(omega.value / np.sqrt(16.12 / trial.truth["yaw_inertia"]) - 1.0)
        return float(np.std(found))

    assert spread(plain) < 1e-4
    # the bound of a trial knows the scatter: no mean of runs is better than their own deviations allow
    bounds = [draw_trial(cell, grid.seed, 0).bound["yaw_inertia"] for cell in (plain, scattering)]
    assert bounds[1] > 0.01 * 0.098 / np.sqrt(scattering.runs) > 10.0 * bounds[0]
    assert 0.2 < spread(scattering) / 0.005 < 2.0  # half of the spring's 1 %; 99.9 % of chi squared of 11
