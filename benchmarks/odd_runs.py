"""Campaigns with one odd run: the share in which it is named, and the share in which a false cause is decided.

Run as ``python -m benchmarks.odd_runs --seed S --campaigns N``. Half of the campaigns are from the reference
simulator, half from the forward one, with no, one or two causes. One run of each is spoilt in one of seven
ways. With ``--without`` no run is spoilt, and the lost answers and the falsely named runs are counted.
``--answers FILE`` appends every answer to a file, and continues there. Thresholds are chosen on seeds below
1000, tested on others.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import diagnose
from diagnosis.result import Diagnosis
from tunnel_reference.draw import Mixture
from tunnel_reference.make import as_campaign, draw_set, simulate_set, truth_of
from tunnel_sim.effects import BetweenRuns, known_effects
from tunnel_sim.effects.sensor import MainsHum, SensorQuantisation
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth
from tunnel_sim.vocabulary.record import Array, Record

KINDS = ("none", "single", "pair")
_SPRINGS, _SPEEDS = (16.12, 30.5, 44.84), (0.0, 12.0, 18.0, 25.0)
_RATE = 250.0  # Hz, of the forward simulator's campaigns
_SIZES = (0.5, 2.0)  # sizes of their causes, in multiples of the effect's example


# ---- faults of one run: new times and readings from the old ones ----


def held(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """A hand holds the body at the start, and follows it for a moment."""
    rate, zero = (time_s.size - 1) / (time_s[-1] - time_s[0]), float(np.median(yaw))
    cycle = _cycle(yaw - zero)
    hold = round(cycle * rng.uniform(0.1, 0.5))
    slip = rng.uniform(-0.1, 0.02) * (yaw[0] - zero)
    noise = rng.normal(0.0, _noise(yaw), hold)
    before = yaw[: max(1, cycle // 40)].mean() - slip * np.linspace(1.0, 0.0, hold) ** 2 + noise
    stamps = time_s[0] + np.arange(hold + yaw.size) / rate
    return stamps, np.concatenate([before, yaw])


def low_passed(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """The logger's filter is on: second order, at two to six times the frequency of the motion."""
    from scipy.signal import butter, lfilter, lfilter_zi

    corner = rng.uniform(2.0, 6.0) / _cycle(yaw - np.median(yaw))  # per sample
    numerator, denominator = butter(2, min(2.0 * corner, 0.9))
    first = lfilter_zi(numerator, denominator) * yaw[0]
    return time_s, lfilter(numerator, denominator, yaw, zi=first)[0]


def in_degrees(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """Radians are mistaken for degrees, or the reverse."""
    return time_s, yaw * (np.pi / 180.0) ** rng.choice([-1.0, 1.0])


def struck(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """A blow: a free motion of the run's own frequency and decay is added."""
    swing = yaw - np.median(yaw)
    at, cycle, decay = round(rng.uniform(0.2, 0.7) * yaw.size), _cycle(swing), _decay(swing)
    since = np.maximum(np.arange(yaw.size) - at, 0)
    wave = np.sin(2.0 * np.pi * since / cycle) * np.exp(-decay * since)
    return time_s, yaw + rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.4) * np.abs(swing).max() * wave


def released_again(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """A second release, from a part of the first angle."""
    zero, at = float(np.median(yaw)), round(rng.uniform(0.35, 0.65) * yaw.size)
    again = zero + rng.uniform(0.3, 1.0) * (yaw[: yaw.size - at] - zero)
    return time_s, np.concatenate([yaw[:at], again])


def amplified(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """Another gain of the amplifier."""
    return time_s, yaw * rng.uniform(1.1, 1.6) ** rng.choice([-1.0, 1.0])


def clipped(rng: np.random.Generator, time_s: Array, yaw: Array) -> tuple[Array, Array]:
    """The amplifier saturates."""
    zero = float(np.median(yaw))
    limit = rng.uniform(0.5, 0.9) * np.abs(yaw - zero).max()
    return time_s, np.clip(yaw, zero - limit, zero + limit)


FAULTS: dict[str, Callable[[np.random.Generator, Array, Array], tuple[Array, Array]]] = {
    "held start": held,
    "low-pass": low_passed,
    "wrong unit": in_degrees,
    "blow": struck,
    "second release": released_again,
    "gain": amplified,
    "clipping": clipped,
}


def _cycle(swing: Array) -> int:
    """Samples of a cycle at the start of a decay."""
    smooth = np.convolve(swing, np.ones(5) / 5.0, "same")
    large = smooth[: np.flatnonzero(np.abs(smooth) > 0.2 * np.abs(smooth).max())[-1]]
    crossings = np.flatnonzero(np.diff(np.sign(large)) != 0)
    spacing = np.diff(crossings)
    return max(8, round(2.0 * float(np.median(spacing[spacing > 3])))) if spacing.size else swing.size // 10


def _decay(swing: Array) -> float:
    """Decay rate of a swing, per sample."""
    half = swing.size // 2
    ratio = float(np.std(swing[half:]) / np.std(swing[:half]))
    return -float(np.log(np.clip(ratio, 1e-3, 0.999))) / half


def _noise(yaw: Array) -> float:
    """Standard deviation of the noise, from second differences."""
    return float(np.std(np.diff(yaw, 2)) / np.sqrt(6.0))


# ---- campaigns ----


@dataclass(frozen=True, eq=False)
class Made:
    """A campaign with its truth.

    Args:
        effects: true causes, sorted.
        fault: fault of one run; empty: none.
        run: id of that run; empty without a fault.
    """

    campaign: Campaign
    effects: tuple[str, ...]
    simulator: str
    fault: str = ""
    run: str = ""


def made(count: int, seed: int, *, odd: bool) -> list[Made]:
    """Campaigns from both simulators in turn; equal arguments give equal campaigns.

    Args:
        odd: whether one run of each is spoilt.
    """
    half = count // 2
    of_reference, forward = _of_reference(count - half, seed), _forward(half, seed)
    both = [*of_reference, *forward]
    both[::2], both[1::2] = of_reference, forward
    return _each_spoilt(both, seed) if odd else both


def _each_spoilt(campaigns: Sequence[Made], seed: int) -> list[Made]:
    rng = np.random.default_rng([seed, 1])
    order = [name for _ in range(-(-len(campaigns) // len(FAULTS))) for name in rng.permutation(list(FAULTS))]
    found = []
    for one, fault in zip(campaigns, map(str, order), strict=False):
        run = one.campaign.runs[int(rng.integers(len(one.campaign.runs)))]
        time_s, yaw = FAULTS[fault](rng, run.record.time_s, run.record.yaw_rad)
        step = one.campaign.sensor.resolution or 0.0
        if fault != "wrong unit" and step > 0.0:  # the unit is read after the converter
            yaw = np.round(yaw / step) * step
        runs = tuple(replace(r, record=Record(time_s, yaw)) if r is run else r for r in one.campaign.runs)
        found.append(replace(one, campaign=replace(one.campaign, runs=runs), fault=fault, run=run.id))
    return found


def _of_reference(count: int, seed: int) -> list[Made]:
    mixture = Mixture(variety=0.0, small=0.0)
    drawn = simulate_set(draw_set(count, seed, dict.fromkeys(KINDS, 1.0), mixture))
    return [
        Made(as_campaign(o, f"a{i:03}"), tuple(truth_of(o)["effects"]), "reference")
        for i, o in enumerate(drawn)
    ]


def _forward(count: int, seed: int) -> list[Made]:
    from tunnel_sim.engine.virtual_campaign import simulate_campaign

    found, rng = [], np.random.default_rng([seed, 2])
    while len(found) < count:
        plan = _plan(rng, f"b{len(found):03}", number=len(found) % len(KINDS))
        campaign = simulate_campaign(plan, nthread=1)
        found.append(Made(campaign, tuple(sorted(e.name for e in plan.effects)), "forward"))
    return found


def _plan(rng: np.random.Generator, name: str, number: int) -> CampaignPlan:
    """A plan of two springs, two or three winds and one or two angles, with a number of causes."""
    springs = sorted(rng.choice(_SPRINGS, 2, replace=False).tolist())
    speeds = [0.0, *sorted(rng.choice(_SPEEDS[1:], int(rng.integers(1, 3)), replace=False).tolist())]
    angles = [0.35, 0.17][: 2 if len(speeds) == 2 else 1]
    conditions = [(k, v, a) for k in springs for v in speeds for a in angles]
    able = [
        kind
        for kind in known_effects()
        if not (kind.driven or issubclass(kind, (BetweenRuns, MainsHum, SensorQuantisation)))
    ]
    kinds = [able[i] for i in rng.choice(len(able), number, replace=False)]
    effects = []
    for kind in kinds:
        names = [one.name for one in kind.parameters()]
        values = dict(zip(names, kind.example, strict=False))
        values[names[0]] *= float(np.exp(rng.uniform(*np.log(_SIZES))))
        if spring := kind.chosen_spring():
            values[spring] = springs[int(rng.integers(2))]
        effects.append(EffectSetting(kind.name, values))
    return CampaignPlan(
        name,
        int(rng.integers(1 << 30)),
        Truth(
            float(rng.uniform(0.3, 0.6)),
            float(rng.uniform(-0.4, -0.1)),
            0.11,
            float(rng.uniform(0.005, 0.02)),
        ),
        tuple(Condition(f"r{i:02}", k, v, 1.2, a, 10.0) for i, (k, v, a) in enumerate(conditions, 1)),
        SensorModel(_RATE, zero=float(rng.normal(0.0, 0.003))),
        tuple(effects),
    )


# ---- answers ----


def answered(one: Made) -> dict[str, Any]:
    """Truth and answer of a campaign; a refusal counts as an answer without causes, which may name the run."""
    begun = time.process_time()
    truth = {"fault": one.fault, "run": one.run, "effects": list(one.effects), "simulator": one.simulator}
    found: dict[str, Any] = {"name": one.campaign.name, "truth": truth, "runs": len(one.campaign.runs)}
    try:
        found |= _scored(diagnose(one.campaign))
    except TunnelError as error:
        words = str(error)
        ids = [run.id for run in one.campaign.runs if run.id in words]
        found |= {
            "refused": words[:300],
            "causes": [],
            "decided": False,
            "named": ids if len(ids) == 1 else [],
        }
    return found | {"seconds": round(time.process_time() - begun, 1)}


def _scored(answer: Diagnosis) -> dict[str, Any]:
    remarked = [run for remark in answer.remarks if len(remark.runs) == 1 for run in remark.runs]
    disturbed = [one.run for one in answer.disturbed]
    outlier = answer.repeatability.outlier if answer.repeatability is not None else ""
    return {
        "causes": list(answer.causes),
        "decided": answer.decision.decided,
        "probability": round(answer.candidates[0].probability, 3),
        "named": sorted({*remarked, *disturbed, *filter(None, [outlier])}),
        "disturbed": disturbed,
        "verdict": answer.verdict,
    }


def right_run(one: Mapping[str, Any]) -> bool:
    """Whether exactly the odd run is named; without an odd run, whether none is named."""
    return bool(one["named"] == ([one["truth"]["run"]] if one["truth"]["run"] else []))


def false_causes(one: Mapping[str, Any]) -> list[str]:
    """Decided causes that are false; scatter is also false, since the runs repeat."""
    if not one["decided"] or one["causes"] == ["unknown"]:
        return []
    return sorted(set(one["causes"]) - set(one["truth"]["effects"]))


def _right(one: Mapping[str, Any]) -> bool:
    return bool(one["decided"] and one["causes"] == one["truth"]["effects"])


def _row(title: str, some: Sequence[Mapping[str, Any]]) -> str:
    counts = (
        len(some),
        sum(map(right_run, some)),
        sum(map(bool, map(false_causes, some))),
        sum(map(_right, some)),
    )
    return "{:16} {:9} {:9} {:12} {:12}".format(title, *counts)


def main() -> None:
    """Answer the campaigns, and print the counts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.odd_runs", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--campaigns", type=int, default=20)
    parser.add_argument("--without", action="store_true", help="no run is spoilt")
    parser.add_argument("--answers", type=Path, help="file to which every answer is appended")
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign to answer")
    parser.add_argument("--every", type=int, default=1, help="answer one campaign in so many")
    given = parser.parse_args()
    known: list[dict[str, Any]] = []
    if given.answers is not None and given.answers.exists():
        known = [json.loads(line) for line in given.answers.read_text(encoding="utf-8").splitlines()]
    done = {one["name"] for one in known}
    for one in made(given.campaigns, given.seed, odd=not given.without)[given.first :: given.every]:
        if one.campaign.name in done:
            continue
        known.append(answered(one))
        if given.answers is not None:
            with given.answers.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(known[-1], ensure_ascii=False) + "\n")
    print(
        "{:16} {:>9} {:>9} {:>12} {:>12}".format("", "campaigns", "run right", "false causes", "causes right")
    )
    for fault in dict.fromkeys(one["truth"]["fault"] for one in known):
        print(_row(fault or "no odd run", [one for one in known if one["truth"]["fault"] == fault]))
    for number in range(3):
        print(_row(f"{number} causes", [one for one in known if len(one["truth"]["effects"]) == number]))
    print(_row("all", known))


if __name__ == "__main__":
    main()
