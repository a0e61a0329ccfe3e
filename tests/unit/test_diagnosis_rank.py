"""Effects added one by one and two by two: what is put in comes out first."""

import numpy as np
import pytest

from diagnosis.attribution.rank import rank_pairs, rank_singles
from tests.unit.gap_campaigns import DURATION, INTERVAL, campaign, nominal
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from

FEW = tuple(
    effect_class(name)
    for name in (
        "coulomb_friction",
        "quadratic_damping",
        "cubic_stiffness",
        "nonlinear_yaw_moment",
        "sensor_drift",
    )
)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb_friction", {"friction_moment": 0.002}),
        ("nonlinear_yaw_moment", {"coefficient": -0.5}),
        ("rod_flexibility", {"compliance": 8e-5, "inertia_share": 0.1}),
        ("sensor_clipping", {"limit": 0.33}),
    ],
)
def test_the_effect_put_in_fits_best_among_all(name, values):
    base = nominal(campaign(effect_from(name, values)))
    told = []
    ranked = rank_singles(base, [kind for kind in ALL_EFFECTS if kind.fitted], told.append)
    assert ranked[0].effects == (name,)
    assert abs(ranked[0].fit.excess) < 6.0 * np.sqrt(2.0 / ranked[0].fit.count)
    totals = [h.fit.total for h in ranked]
    assert totals == sorted(totals)
    assert {h.effects[0] for h in ranked} <= set(told)
    severity, value = next(iter(values.items()))
    found = ranked[0].fit
    # compliance and share of a rod form a narrow, curved valley: a refit stops in it short of the bottom
    tolerance = 0.1 * value if name == "rod_flexibility" else 5.0 * found.std(f"{name}.{severity}")
    assert abs(found.value(f"{name}.{severity}") - value) < tolerance


def test_the_pair_put_in_fits_best_and_is_named_once():
    drift = 2e-3 * np.linspace(0.0, 1.0, round(DURATION / INTERVAL))
    base = nominal(campaign(effect_from("quadratic_damping", {"coefficient": 0.003}), added=drift))
    singles = rank_singles(base, FEW)
    pairs = rank_pairs(singles, FEW)
    assert pairs[0].names == ("quadratic_damping", "sensor_drift")
    assert pairs[0].fit.total < singles[0].fit.total
    assert len({pair.names for pair in pairs}) == len(pairs)
    assert abs(pairs[0].fit.excess) < 6.0 * np.sqrt(2.0 / pairs[0].fit.count)
