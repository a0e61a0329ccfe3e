"""Wind speeds that agree within their reading are one setting."""

import pytest

from tunnel_sim.vocabulary.campaign import speed_groups


@pytest.mark.parametrize(
    ("speeds", "settings"),
    [
        ((25.0, 24.9972), {25.0: 25.0, 24.9972: 25.0}),
        ((0.0, 0.05), {0.0: 0.0, 0.05: 0.05}),
        ((10.0, 10.3, 20.0), {10.0: 10.0, 10.3: 10.3, 20.0: 20.0}),
        ((15.02, 14.97, 15.0, 15.02), {14.97: 15.0, 15.0: 15.0, 15.02: 15.0}),
    ],
)
def test_readings_of_one_setting_are_one_speed(speeds, settings):
    assert speed_groups(speeds) == settings


def test_a_series_of_close_speeds_is_not_one_setting():
    """Each is 0.6 % above the one before: the first and the last differ by a sixth."""
    series = [10.0 * 1.006**k for k in range(26)]
    assert len(set(speed_groups(series).values())) > 10
