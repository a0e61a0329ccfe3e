"""A diagnosis written by hand: every number differs from every other, so that none can stand in for another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from diagnosis.result import Diagnosis
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

CAUSE, RIVAL = "quadratic_damping", "coulomb_friction"
IDS = ("alpha", "beta", "gamma")
CONDITIONS = ((16.25, 0.0, 7.31, 400.0), (44.75, 13.5, 8.42, 500.0), (None, 21.5, 9.53, 625.0))


def campaign() -> Campaign:
    """Three runs of different springs, speeds, durations and rates; the last one states no spring."""
    runs = []
    for name, (spring, speed, duration, rate) in zip(IDS, CONDITIONS, strict=True):
        time = np.arange(round(duration * rate) + 1) / rate
        runs.append(Run(name, Record(time, 0.3 * np.cos(11.0 * time)), speed, spring, 1.2, 0.3))
    return Campaign(
        "by hand", RigProperties(0.11, 0.036, 0.625, 0.225), SensorProperties(500.0, None, 4e-4), tuple(runs)
    )


def findings_of(written: Mapping[str, Any]) -> Diagnosis:
    """The diagnosis that a document states; what a document written by hand leaves out is empty.

    Args:
        written: some of the fields of `document`, and of the parts of a diagnosis.
    """
    given = {**_NOTHING, **written}
    filled = {name: _filled(value, _PARTS.get(name)) for name, value in given.items()}
    return Diagnosis.from_json_dict({"schema_version": 1, **filled})


def _filled(given: Any, empty: Any) -> Any:
    """A part of a document with the fields that it lacks.

    Args:
        empty: the fields of such a part, as they are where nothing is stated; of a list, one member in a list.
    """
    if isinstance(empty, Mapping) and isinstance(given, Mapping):
        return {**empty, **{name: _filled(value, empty.get(name)) for name, value in given.items()}}
    if isinstance(empty, list) and empty and isinstance(given, list):
        return [_filled(one, empty[0]) for one in given]
    return given


_NOTHING: Mapping[str, Any] = {
    "campaign": "by hand", "causes": [], "decided": True, "credible": [], "common": {}, "gap": {}, "where": {},
    "candidates": [], "ambiguous_with": [], "next_run": None, "coefficients": {}, "confirmation": {}, "noise": {},
    "waterfall": [], "waterfall_on": "", "without": {},
}  # fmt: skip
_PARTS: Mapping[str, Any] = {
    "common": {"effects": {}, "channels": {}},
    "gap": {
        "detected": False, "excess_before": 0.0, "excess_after": 0.0, "closed": 0.0, "closed_on": "", "runs": [],
        "false_alarm_rate": 0.01, "p_value": 1.0, "tests": {},
        "misfit": {"noise": 1.0, "swing": 1.0, "unit": "rad"},
    },
    "where": {"channel": None, "condition": None},
    "candidates": [{"excess_after": 0.0, "closed": 0.0}],
    "rest": {"significant": False, "excess": 0.0, "p_value": 1.0, "material": False, "moves": {}},
    "coefficients": {"before": {}, "after": {}},
    "confirmation": {
        "agrees": True, "largest_difference_rad": 0.0, "run": "", "rms_difference_rad": 0.0, "tolerance_rad": 0.0,
    },
    "noise": {"std": 4e-4, "stated_std": None, "source": "estimated"},
    "closable": {"excess": 1.0},
    "model": {
        "joint": "yaw", "free": [], "rest_rad": 0.0, "zero_rad": 0.0, "written": [], "notes": [],
        "differences": [], "closed": 0.0, "closed_by_fit": 0.0, "closed_on": "",
    },
}  # fmt: skip


def rms(excess: Any) -> Any:
    """A misfit in degrees, by the noise of the document."""
    return np.degrees(4.5e-4) * np.sqrt(np.maximum(excess, 0.0))


def both(excess: float) -> list[float]:
    """A gap in degrees and in noise variances."""
    return [float(rms(excess)), excess]


def document() -> dict[str, Any]:
    """The answer, in JSON's types."""
    return {
        "schema_version": 1,
        "campaign": "by hand",
        "causes": [CAUSE],
        "verdict": "",
        "gap": {
            "detected": True,
            "excess_before": 27.35,
            "excess_after": 0.1234,
            "closed": 0.9876,
            "closed_on": "on held-out runs",
            "runs": [
                {"id": "alpha", "before": 31.72, "after": -0.0567, "held_out": True},
                {"id": "beta", "before": 4.583, "after": 0.2345, "held_out": False},
                {"id": "gamma", "before": 0.6789, "after": 0.3456, "held_out": True},
            ],
            "false_alarm_rate": 0.013,
            "p_value": 2.9e-9,
            "tests": {"white": 3.7e-8, "lines": 0.0042},
            "misfit": {"noise": 4.5e-4, "swing": 0.0815, "unit": "rad", "before": 0.0023534, "after": 1.5808e-4},
        },
        "where": {
            "channel": "damping",
            "condition": "always",
            "runs": ["alpha", "gamma"],
            "time_s": [0.125, 3.375],
            "amplitude_rad": [0.1725, 0.3375],
            "frequency_hz": [1.875, 2.625],
            "words": "",
        },
        "candidates": [
            _candidate(CAUSE, 0.9123, 0.1478, 0.9754, coefficient=(0.003125, 1.7e-5, "N m s2/rad2")),
            _candidate(RIVAL, 0.0512, 1.567, 0.5151, friction_moment=(0.0081, 2.3e-4, "N m"),
                       shift=(-0.27, 0.0, "s")),
            _candidate("unknown", 0.0213, 27.95, 0.0),
            _candidate("sensor_drift", 0.0147, 26.15, 0.0331),
            _candidate("none", 0.0004, 28.25, 0.0),
            _candidate("mains_hum", 0.00005, 27.05, 0.0123),
            _candidate("sensor_delay", 0.00003, 27.15, 0.0134),
        ],
        "inclusion": {RIVAL: 0.0654, CAUSE: 0.9321, "free_play": 0.0023},
        "waterfall": [
            {"effect": None, "excess": 28.45},
            {"effect": CAUSE, "excess": 2.75},
            {"effect": RIVAL, "excess": 0.1345},
        ],
        "waterfall_on": "on held-out runs",
        "without": {CAUSE: 21.85, RIVAL: 2.85},
        "sizes": [
            {"effect": CAUSE, "run": "beta", "amplitude_rad": 0.1625, "damping_ratio": 0.01335,
             "damping_ratio_without": 0.01115, "frequency_change": -0.00075, "zero_change": 1.5e-5,
             "reading_change": 0.00315, "stands_rad": 0.00105},
        ],
        "rest": {
            "significant": True,
            "excess": 0.1345,
            "p_value": 1.9e-5,
            "material": False,
            "moves": {
                "cn_beta": {"value": 0.00043, "relative": 0.000898, "std": 0.0013, "unit": "1/rad",
                            "material": False},
                "cn_r": {"value": 0.00053, "relative": 0.00206, "std": 0.0118, "unit": "1/rad", "material": False},
            },
            "words": "",
            "further": "",
        },
        "decided": True,
        "unpredictive": "",
        "doubts": [],
        "found": found(),
        "ambiguous_with": [RIVAL],
        "next_run": {
            "spring_stiffness": 81.5,
            "wind_speed": 18.25,
            "release_angle": 0.415,
            "duration": 33.5,
            "separation": 52.0,
        },
        "coefficients": {
            "before": {"cn_beta": _value(0.4513, 0.0024, "1/rad"), "cn_r": _value(-0.3132, 0.0225, "1/rad")},
            "after": {"cn_beta": _value(0.4789, 0.0013, "1/rad"), "cn_r": _value(-0.2574, 0.0118, "1/rad")},
            "note": "",
        },
        "confirmation": {
            "model": "mujoco",
            "agrees": True,
            "largest_difference_rad": 1.3e-5,
            "run": "beta",
            "rms_difference_rad": 6.1e-6,
            "tolerance_rad": 4.7e-5,
            "failure": "",
        },
        "noise": {"std": 4.123e-4, "stated_std": 3.987e-4, "source": "estimated", "reason": "from the records"},
        "blind_spots": [],
        "cautions": [],
        "credible": [{"effect": CAUSE, "probability": 0.9123}],
        "common": {"effects": {CAUSE: 0.9123}, "channels": {"damping": 0.9623}},
        "closable": None,
        "model": None,
        "remarks": [],
        "seconds": {"fit": 12.3, "rank": 45.6},
        "maps": maps(),
        "provenance": {},
    }  # fmt: skip


def found() -> dict[str, Any]:
    """What is found beside the numbers."""
    return {
        "place": {
            "runs": 3,
            "share": 0.8765,
            "false_alarm_rate": 0.01,
            "wind": {"off": 4.25, "on": 17.85},
            "narrow": ["time_s", "amplitude_rad", "frequency_hz"],
            "bands": {"f0": 0.7272, "3f0": 0.1313},
            "channel": {"kind": "damping along the decay"},
            "condition": {"kind": "wind-off runs show it", "runs": 2},
            "compared": [CAUSE],
            "agrees": True,
        },
        "nowhere": None,
        "both_winds": True,
        "nearly": None,
        "immaterial": {},
        "choices": [],
        "rivals": [],
        "second_modes": [],
        "limit_cycles": [],
        "noise": {"kind": "not stated"},
        "cautions": [{"kind": "few runs", "runs": 2, "driven": False, "windy": True}],
        "noted": [{"kind": "not judged", "runs": list(IDS)}],
    }


def maps() -> dict[str, Any]:
    """The pictures' data."""
    return {
        "runs": [
            {"id": name, "spring_stiffness": spring, "wind_speed": speed, "amplitude_rad": 0.31,
             "frequency_hz": 2.15, "excess": excess, "std": std, "p_value": 1.7e-7, "share": share}
            for name, (spring, speed, *_), excess, std, share in zip(
                IDS, CONDITIONS, (31.5, 4.5, 0.65), (0.021, 0.019, 0.017), (0.86, 0.12, 0.02), strict=True
            )
        ],
        "groups": [{"by": "wind", "label": "off", "runs": 1, "excess": 31.5, "std": 0.021}],
        "time": {
            "edges_s": [0.0, 2.0, 5.0, 9.0],
            "excess": [30.0, 12.0, 3.0],
            "std": [0.031, 0.032, 0.033],
            "by_run": [[60.0, 21.0, 0.01], [9.0, 0.02, 1.5], [2.0, 0.5, None]],
            "moment_share": [0.55, 0.34, 0.11],
        },
        "amplitude": {"edges_rad": [0.0, 0.1, 0.3], "excess": [1.5, 25.0], "std": [0.041, 0.042]},
        "frequency": {
            "edges_hz": [0.0, 1.0, 4.0, 16.0],
            "excess": [1.25, 80.0, -0.9],
            "std": [0.051, 0.052, 0.4],
            "after": [0.15, 0.75, 0.05],
            "by_run": [[1.35, 85.0, -0.8], [1.15, 75.0, 0.1], [0.95, 65.0, None]],
            "resonance_hz": [1.9, 2.6],
        },
        "bands": [{"band": "f0", "excess": 7250.0, "mean": 30.5, "p_value": 1.3e-8}],
        "lines": [
            {"run": "alpha", "frequency_hz": 50.13, "share": 0.1357, "amplitude_rad": 2.4e-4},
            {"run": "beta", "frequency_hz": 99.87, "share": 0.2468, "amplitude_rad": 8.3e-4},
        ],
        "backbones": [_backbone("alpha", 1.95), _backbone("beta", 2.45), _backbone("gamma", 2.55)],
        "phase_plane": {
            "edges_rad": [-0.4, 0.0, 0.4],
            "moment": [[0.012, -0.025], [None, 0.001]],
            "std": [[0.001, 0.002], [None, 0.003]],
            "by_angle": [0.014, -0.016],
            "by_angle_std": [0.0011, 0.0012],
            "by_rate": [0.017, 0.019],
            "by_rate_std": [0.0013, 0.0014],
            "unit": "N m",
            "runs": ["alpha", "gamma"],
        },
        "grid": {
            "amplitude_edges_rad": [0.0, 0.15, 0.32],
            "wind_speeds": [0.0, 13.5, 21.5],
            "time_edges_s": None,
            "excess": [[2.25, 4.25, None], [6.25, 0.05, 9.25]],
            "std": [[0.044, 0.045, None], [0.046, 0.047, 0.048]],
        },
        "unit": "rad",
        "traces": [
            {"id": "alpha", "time_s": [0.0, 1.0, 2.0], "reading_rad": [0.31, -0.26, 0.21],
             "differ_s": [0.5, 2.0], "before_rad": [0.004, -0.003, 0.002],
             "after_rad": [0.0004, -0.0005, 0.0006], "noise_std_rad": 1e-4},
            {"id": "gamma", "time_s": [0.0, 1.5, 3.0], "reading_rad": [-0.29, 0.24, -0.19],
             "differ_s": [0.0, 1.5], "before_rad": [0.007, -0.006, 0.005],
             "after_rad": None, "noise_std_rad": 1e-4},
        ],
    }  # fmt: skip


def _candidate(
    effect: str, probability: float, excess: float, closed: float, **parameters: tuple[float, float, str]
) -> dict[str, Any]:
    return {
        "effect": effect,
        "probability": probability,
        "excess_after": excess,
        "closed": closed,
        "parameters": {name: _value(*given) for name, given in parameters.items()},
    }


def _value(value: float, std: float, unit: str) -> dict[str, Any]:
    return {"value": value, "std": std, "unit": unit}


def _backbone(name: str, nominal: float) -> dict[str, Any]:
    return {
        "id": name,
        "time_s": [1.0, 2.0, 3.0],
        "amplitude_rad": [0.3, 0.2, 0.1],
        "frequency_hz": [1.01 * nominal, 1.02 * nominal, 1.04 * nominal],
        "frequency_std": [0.001, 0.002, 0.003],
        "zeta": [0.012, 0.013, 0.015],
        "zeta_std": [0.0001, 0.0002, 0.0003],
        "nominal_frequency_hz": nominal,
        "nominal_zeta": 0.011,
    }


def scattering_document() -> dict[str, Any]:
    """The same answer beside chance differences between the runs; one run deviates far beyond the others."""
    given = document()
    names = ["wind_speed_scatter", "damping_scatter"]
    given["ambiguous_with"] = []
    given["causes"] = sorted([CAUSE, *names])
    effect = " + ".join(given["causes"])
    given["candidates"][0]["effect"] = effect
    given["candidates"][0]["parameters"] = {
        f"{CAUSE}.coefficient": _value(0.003125, 1.7e-5, "N m s2/rad2"),
        "wind_speed_scatter.spread": {"value": 0.00293, "std": None, "unit": "1"},
        "damping_scatter.spread": {"value": 0.0117, "std": None, "unit": "1"},
    }
    given["credible"] = [{"effect": effect, "probability": 0.9123}]
    given["waterfall"][1:1] = [{"effect": " + ".join(names), "excess": 9.25}]
    given["repeatability"] = {
        "spreads": [
            _spread("wind_speed_scatter", 0.00291, (0.00132, 0.00619), {"beta": -0.00623, "gamma": 0.00514}),
            _spread(
                "stiffness_scatter", 0.000321, (0.00016, 0.00064), dict.fromkeys(IDS, 0.0001), shown=False
            ),
            _spread(
                "damping_scatter",
                0.0101,
                (0.0062, 0.0185),
                {"alpha": 0.0107, "beta": -0.0211, "gamma": 0.0023},
            ),
        ],
        "runs": [
            _repeat("alpha", 1.913, 0.01157, (-1.9e-4, 6.8e-7), (0.0105, 1.8e-4), (1.5e-4, 0.0102), 0.89),
            _repeat("beta", 2.427, 0.01259, (-0.0119, 1.3e-6), (-0.0043, 9.7e-5), (3.9e-4, 0.0039), 2e-6),
            _repeat("gamma", 2.531, 0.02053, (4.9e-4, 2.1e-6), (0.0017, 9.5e-5), (0.0013, 0.0033), 1.0),
        ],
        "outlier": "beta",
        "trends": [],
    }
    return given


def _spread(
    effect: str,
    width: float,
    interval: tuple[float, float],
    deviations: dict[str, float],
    *,
    shown: bool = True,
) -> dict[str, Any]:
    return {
        "effect": effect,
        "width": width,
        "interval": list(interval),
        "stated": None,
        "shown": shown,
        "deviations": deviations,
    }


def _repeat(
    name: str,
    hertz: float,
    zeta: float,
    frequency: tuple[float, float],
    damping: tuple[float, float],
    bands: tuple[float, float],
    p_value: float,
) -> dict[str, Any]:
    return {
        "id": name,
        "windy": name != "alpha",
        "frequency_hz": hertz,
        "damping_ratio": zeta,
        "frequency": frequency[0],
        "frequency_std": frequency[1],
        "damping": damping[0],
        "damping_std": damping[1],
        "frequency_band": bands[0],
        "damping_band": bands[1],
        "p_value": p_value,
    }
