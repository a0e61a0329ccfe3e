"""A diagnosis refuses what no model can be fitted to, at once and in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from tests.support.gap_campaigns import campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record


def _with_first(values: Array) -> Campaign:
    sound = campaign()
    first = sound.runs[0]
    return replace(sound, runs=(replace(first, record=Record(first.record.time_s, values)), *sound.runs[1:]))


@pytest.mark.parametrize("scale", [0.0, 1e-200])
def test_a_run_without_motion_is_refused_by_name(scale):
    count = campaign().runs[0].record.time_s.size
    values = scale * np.cos(np.arange(count) / 30.0)
    with pytest.raises(TunnelError, match=r"run r1.*no decaying motion"):
        diagnose(_with_first(values))


def test_noise_alone_is_refused_by_name():
    count = campaign().runs[0].record.time_s.size
    with pytest.raises(TunnelError, match="run r1"):
        diagnose(_with_first(1e-3 * np.random.default_rng(1).standard_normal(count)))


def test_a_stiffness_out_of_all_range_is_refused():
    sound = campaign()
    runs = (replace(sound.runs[0], spring_stiffness=1e-300), *sound.runs[1:])
    with pytest.raises(TunnelError, match=r"spring_stiffness = 1e-300"):
        diagnose(replace(sound, runs=runs))
