"""Where sizes or springs are not stated, what is identified has its own name and unit."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis._diagnose import diagnose, vocabulary
from diagnosis.findings.units import own_parameters, parameter_unit, sized_coefficients
from diagnosis.model.choose import nominal_model
from diagnosis.model.rig import PerInertia
from diagnosis.model.similar import similar_campaign
from diagnosis.model.similarity import Similarity
from identification import identify
from identification.show.quantity import Quantity
from tests.marks import slow
from tests.reference import free_decays
from tests.reference.free_decays import AREA, LENGTH, Setting
from tests.support import gap_campaigns
from tunnel_sim.effects import ALL_EFFECTS, effect_from
from tunnel_sim.vocabulary.campaign import RigProperties
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.freedom import DISPLACEMENT

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

SETTINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0))
RIGS = {
    "both": (RigProperties(None, AREA, LENGTH), {"cn_beta": 1.0, "cn_r": 1.0}, ("1/rad", "1/rad")),
    "no area": (
        RigProperties(None, None, LENGTH), {"cn_beta_area": AREA, "cn_r_area": AREA}, ("m2/rad", "m2/rad"),
    ),
    "no length": (
        RigProperties(None, AREA, None),
        {"cn_beta_length": LENGTH, "cn_r_length2": LENGTH**2}, ("m/rad", "m2/rad"),
    ),
    "neither": (
        RigProperties(),
        {"cn_beta_area_length": AREA * LENGTH, "cn_r_area_length2": AREA * LENGTH**2}, ("m3/rad", "m4/rad"),
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def data():
    return free_decays.campaign(SETTINGS, noise=4e-4, duration=5.0, rate=500.0, rng=np.random.default_rng(2))


@pytest.mark.parametrize("name", ["neither", slow("both"), slow("no area"), slow("no length")])
def test_what_is_identified_is_the_coefficient_times_the_missing_sizes(data, name):
    rig, sizes, units = RIGS[name]
    truth = free_decays.Truth()
    answer = diagnose(replace(data, rig=rig), kinds=vocabulary(["sensor_drift"]))
    assert answer.causes == ()
    for found in (answer.coefficients.before, answer.coefficients.after):
        assert set(found) == set(sizes)
        for (key, size), unit, value in zip(sizes.items(), units, (truth.cn_beta, truth.cn_r), strict=True):
            assert found[key].unit == unit
            assert abs(found[key].value - size * value) < 4.0 * found[key].std < 0.1 * abs(size * value)
    note = answer.coefficients.note
    assert ("[rig] states no" in note) == (name != "both")
    if name == "neither":
        assert "Cnβ·A·l and Cnr·A·l² are identified, not Cnβ and Cnr" in note


def test_other_coefficients_keep_their_names():
    found = {"omega_n": Quantity(12.0, 0.1, "rad/s")}
    assert sized_coefficients(found, RigProperties()) == found


def test_units_without_springs_and_sizes(data):
    bare = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs))
    small = replace(data, rig=RigProperties())
    cases = {
        "coulomb_friction.friction_moment": ("N m", "rad/s2", "N m"),
        "gravity_stiffness.stiffness": ("N m/rad", "1/s2", "N m/rad"),
        "quadratic_damping.coefficient": ("N m s2/rad2", "1/rad", "N m s2/rad2"),
        "rod_flexibility.compliance": ("rad/(N m)", "s2", "rad/(N m)"),
        "buffeting.intensity": ("1", "1/(kg m2)", "m3"),
        "vortex_shedding.amplitude": ("1", "1/(kg m2)", "m3"),
        "unsteady_aero_lag.lag": ("l/V", "l/V", "m"),
        "sensor_drift.drift": ("rad", "rad", "rad"),
    }
    for name, units in cases.items():
        assert tuple(parameter_unit(name, d, nominal_model(d)) for d in (data, bare, small)) == units
    nothing = replace(bare, rig=RigProperties())
    assert parameter_unit("buffeting.intensity", nothing, PerInertia()) == "m/kg"
    thin = replace(nothing, runs=tuple(replace(run, air_density=None) for run in nothing.runs))
    assert parameter_unit("buffeting.intensity", thin, PerInertia()) == "1/m2"  # the density is within it


def test_an_angular_frequency_does_not_scale_with_a_displacement(data):
    given = {
        "second_mode.amplitude": Quantity(0.02, 0.01, "rad"), "second_mode.frequency": Quantity(60.0, 0.1, "rad/s"),
        "second_mode.damping_ratio": Quantity(0.01, 0.001, "1"),
    }  # fmt: skip
    found = own_parameters(given, data, Similarity(time=2.0, angle=128.0), nominal_model(data))
    assert found["second_mode.amplitude"].value == pytest.approx(0.02 / 128.0)
    assert found["second_mode.frequency"].value == pytest.approx(Similarity(time=2.0).own(60.0, "Hz"))
    units = {name: DISPLACEMENT.document({name: one})[name].unit for name, one in found.items()}
    assert list(units.values()) == ["m", "1/s", "1"]


@pytest.mark.parametrize("quantity", ["angle", "rate", "acceleration"])
@pytest.mark.parametrize("sprung", [True, False], ids=["springs", "no springs"])
@pytest.mark.parametrize("name", RIGS)
def test_every_parameter_is_given_in_a_unit_that_can_be_read_and_in_own_units(data, name, sprung, quantity):
    """A rig of another time scale and another moment: lengths go with time, so products of sizes stay."""
    sensor = replace(data.sensor, quantity=quantity)
    runs = data.runs if sprung else tuple(replace(run, spring_stiffness=None) for run in data.runs)
    stated = replace(data, rig=RIGS[name][0], sensor=sensor, runs=runs)
    _, change = similar_campaign(stated)
    for kind in ALL_EFFECTS:
        infos = {f"{kind.name}.{info.name}": info for info in kind.parameters()}
        given = {key: Quantity(info.default + 0.7, 0.1, info.unit) for key, info in infos.items()}
        textbook = {k: v for k, v in given.items() if not infos[k].form}
        found = own_parameters(textbook, stated, change, nominal_model(stated))
        for key, own in found.items():
            factor = own.value / given[key].value
            dimension(own.unit)
            assert own.std == pytest.approx(0.1 * factor)
            if infos[key].per_pressure or infos[key].unit == "l/V":
                assert factor == 1.0
            elif not sprung:
                assert factor == pytest.approx(change.own(1.0, own.unit))
            else:
                assert own.unit == infos[key].unit


def test_without_springs_and_sizes_no_density_is_needed():
    def bare(density):
        runs = (Setting(None, 12.0), Setting(None, 24.0), Setting(None, 12.0, 0.14))
        found = free_decays.campaign(
            runs, noise=4e-4, duration=5.0, has_size=False, rng=np.random.default_rng(1)
        )
        return replace(found, runs=tuple(replace(run, air_density=density) for run in found.runs))

    kinds = vocabulary(["nonlinear_yaw_damping"])
    answer, told = (diagnose(bare(density), kinds=kinds) for density in (None, 1.2))
    assert answer.causes == told.causes == ()
    for name in ("omega_n", "zeta"):
        same = pytest.approx(told.coefficients.after[name].value, rel=1e-3)
        assert answer.coefficients.after[name].value == same
    found = identify(bare(None))
    assert [run.omega_n.value for run in found.runs] == [r.omega_n.value for r in identify(bare(1.2)).runs]


@pytest.mark.slow
def test_a_lag_is_found_where_no_sizes_are_stated():
    lag = effect_from("unsteady_aero_lag", {"lag": 2.0})
    sized = gap_campaigns.campaign(lag, duration=6.0)
    answer = diagnose(replace(sized, rig=RigProperties()), kinds=vocabulary(["unsteady_aero_lag"]))
    assert answer.causes == ("unsteady_aero_lag",)
    found = answer.candidates[0].parameters["lag"]
    assert found.unit == "m"
    assert abs(found.value - 2.0 * sized.rig.reference_length) < 4.0 * found.std < 0.5


def test_no_unit_of_a_moment_is_left_in_normalised_form(data):
    bare = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs))
    for kind in ALL_EFFECTS:
        for info in kind.parameters():
            assert "N m" not in parameter_unit(f"{kind.name}.{info.name}", bare, PerInertia())
