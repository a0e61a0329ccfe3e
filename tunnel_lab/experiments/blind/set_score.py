"""Check the hashes of a blind set and its answers, open the key and count; calibration of probabilities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from diagnosis.search.answer import UNKNOWN
from identification.statistics import Proportion
from tunnel_lab.experiments.blind.answers import answers_folder, scored
from tunnel_lab.experiments.blind.cases import (
    NAMES,
    Case,
    CausesFound,
    case,
    found_by_group,
    inclusions,
    label,
)
from tunnel_lab.experiments.blind.scatter_score import ScatterScore, scatter_score
from tunnel_lab.experiments.blind.sets import (
    KEY,
    MADE_WITH,
    SEAL,
    MadeWith,
    campaign_folders,
    file_hash,
    folder_hash,
    read_hashes,
)
from tunnel_sim.files.reading import as_described, read_json
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError, counted, shown
from tunnel_sim.vocabulary.record import Array

BINS = 10
_CLOSED = 0.95  # share of the gap from which a case counts as closed: a convention


@dataclass(frozen=True)
class CalibrationBin:
    """Answers of similar probability.

    Args:
        low: lower end of the bin, a probability.
        high: upper end of the bin, a probability.
        mean: mean probability of the answers in the bin.
        right: number of right answers.
    """

    low: float
    high: float
    mean: float
    right: Proportion


def calibration(
    probabilities: Sequence[float], right: Sequence[bool]
) -> tuple[float, tuple[CalibrationBin, ...]]:
    """Expected calibration error, and the bins that hold any answers.

    The error is the mean over answers of |share right − mean probability| by bins of equal width; 0 without
    answers.
    """
    p, hit = np.asarray(probabilities, dtype=float), np.asarray(right, dtype=bool)
    if p.size == 0:
        return 0.0, ()
    which = np.minimum((p * BINS).astype(int), BINS - 1)
    found = []
    error = 0.0
    for number in np.unique(which):
        inside = which == number
        mean, hits = float(p[inside].mean()), Proportion(int(hit[inside].sum()), int(inside.sum()))
        found.append(CalibrationBin(number / BINS, (number + 1) / BINS, mean, hits))
        error += hits.total / p.size * abs(hits.count / hits.total - mean)
    return error, tuple(found)


_POINTS = 401
_WIDTHS = (0.005, 1.0)
_CLOSE = 1e-9  # relative tolerance of the width
_RESAMPLES = 500
_LEAST_WEIGHT = 1.0  # the curve is drawn where the kernel covers at least one statement


@dataclass(frozen=True, eq=False)
class SmoothCalibration:
    """The calibration of some statements without bins (Błasiok and Nakkiran 2023, arXiv:2309.12236).

    Args:
        error: smooth calibration error, a probability.
        interval: interval of 95 %, by resampling campaigns at the width found.
        width: standard deviation of the kernel, chosen to equal the resulting error, a probability.
        stated: probabilities of the curve, shape (points,).
        observed: share of true statements at these probabilities, shape (points,).
        low: lower end of the 95 % interval of this share, shape (points,).
        high: upper end of this interval, shape (points,).
        statements: number of statements.
        campaigns: number of campaigns.
    """

    error: float
    interval: tuple[float, float]
    width: float
    stated: Array
    observed: Array
    low: Array
    high: Array
    statements: int
    campaigns: int

    def to_json_dict(self) -> dict[str, Any]:
        """All figures except the curve."""
        return {
            "error": self.error, "interval_95": list(self.interval), "width": self.width,
            "statements": self.statements, "campaigns": self.campaigns,
        }  # fmt: skip


def smooth_calibration(groups: Sequence[tuple[Sequence[float], Sequence[bool]]]) -> SmoothCalibration | None:
    """Smooth calibration error of statements in groups; None without any.

    Args:
        groups: stated probabilities by campaign, and whether each statement is true.
    """
    if not groups:
        return None
    grid = np.linspace(0.0, 1.0, _POINTS)
    counts, surplus = np.zeros((len(groups), _POINTS)), np.zeros((len(groups), _POINTS))
    for row, (probabilities, true) in enumerate(groups):  # at the nearest points of the grid
        p, y = np.asarray(probabilities, dtype=float), np.asarray(true, dtype=float)
        at = np.rint(p * (_POINTS - 1)).astype(int)
        counts[row] = np.bincount(at, minlength=_POINTS)
        surplus[row] = np.bincount(at, weights=y - p, minlength=_POINTS)
    # The error falls with the width, so exactly one width equals its error.

    def beyond(width: float) -> float:
        return _error(_kernel(grid, width), surplus.sum(axis=0), float(counts.sum())) - width

    width = float(brentq(beyond, *_WIDTHS, xtol=_CLOSE)) if beyond(_WIDTHS[0]) > 0.0 else _WIDTHS[0]
    kernel = _kernel(grid, width)
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(len(groups), np.full(len(groups), 1.0 / len(groups)), _RESAMPLES)
    errors = [_error(kernel, w @ surplus, float((w @ counts).sum())) for w in drawn]
    weight = kernel @ counts.sum(axis=0) * width * np.sqrt(2.0 * np.pi)
    shown = weight >= _LEAST_WEIGHT
    observed = _curve(kernel, counts.sum(axis=0), surplus.sum(axis=0), grid)
    curves = np.stack([_curve(kernel, w @ counts, w @ surplus, grid) for w in drawn])
    ends = np.quantile(curves, (0.025, 0.975), axis=0)
    return SmoothCalibration(
        _error(kernel, surplus.sum(axis=0), float(counts.sum())),
        (float(np.quantile(errors, 0.025)), float(np.quantile(errors, 0.975))),
        width, grid[shown], observed[shown], ends[0][shown], ends[1][shown],
        int(counts.sum()), len(groups),
    )  # fmt: skip


def _kernel(grid: Array, width: float) -> Array:
    """Gaussian density between points of the grid, reflected at 0 and 1, shape (points, points)."""
    place, last = np.arange(grid.size), grid.size - 1
    between = np.arange(-last, 2 * last + 1) / last  # differences and sums of points
    shifts = 2.0 * np.arange(-2, 3)[:, None]
    wrapped = np.exp(-0.5 * ((between - shifts) / width) ** 2).sum(axis=0)
    density = wrapped[place[:, None] - place + last] + wrapped[place[:, None] + place + last]
    return np.asarray(density / (width * np.sqrt(2.0 * np.pi)))


def _error(kernel: Array, surplus: Array, number: float) -> float:
    """∫ |mean of K (truth − probability)| over the probability."""
    return float(np.trapezoid(np.abs(kernel @ surplus), dx=1.0 / (_POINTS - 1)) / number)


def _curve(kernel: Array, counts: Array, surplus: Array, grid: Array) -> Array:
    """Share of true statements by kernel regression: the stated probability plus the local mean surplus."""
    return np.clip(grid + kernel @ surplus / np.maximum(kernel @ counts, 1e-300), 0.0, 1.0)


@dataclass(frozen=True)
class CoefficientErrors:
    """Errors of one coefficient over some campaigns.

    Args:
        group: group of campaigns.
        name: ``cn_beta`` or ``cn_r``.
        when: ``before`` or ``after`` the causes are added.
        covered: number of 95 % intervals that contain the truth.
        rms_z: root mean square of the errors in stated standard deviations; 1 for right standard deviations.
        median_relative_error: median absolute error as a share of the truth.
    """

    group: str
    name: str
    when: str
    covered: Proportion
    rms_z: float
    median_relative_error: float


@dataclass(frozen=True, eq=False)
class BlindScore:
    """The score of a set.

    Args:
        cases: truth and answer of every campaign.
        excluded: effects withheld from the vocabulary.
        key_sha256: published hash of the key; empty for an open set.
        answers_sha256: hash over the answers, published before the key was opened.
        made_with: arguments of `make_blind`; None if unknown.
        sealed: whether the truth was sealed; else it was beside the data, and the test is not blind.
    """

    cases: tuple[Case, ...]
    excluded: tuple[str, ...]
    key_sha256: str
    answers_sha256: str
    made_with: MadeWith | None
    sealed: bool

    def exact(self) -> dict[str, Proportion]:
        """Exact match of the causes, by kind of campaign and severity (in noise variances)."""
        shares = {}
        for kind in ("single", "pair", "three", "four", "none", "outside", "withheld"):
            cases = [c for c in self.cases if c.kind == kind]
            shares[kind] = Proportion.of([c.right for c in cases])
            if kind == "single":
                for level in ("below 1", "1 to 10", "above 10"):
                    shares[f"single, {level}"] = Proportion.of(
                        [c.right for c in cases if c.severity_class == level]
                    )
        shares["all"] = Proportion.of([c.right for c in self.cases])
        return {name: share for name, share in shares.items() if share.total}

    def confusion(self) -> dict[str, dict[str, int]]:
        """Numbers by truth and answer; pairs and ``no answer`` have their own rows and columns."""
        counts: dict[str, dict[str, int]] = {}
        for c in self.cases:
            row = counts.setdefault(_truth(c), {})
            row[label(c.causes)] = row.get(label(c.causes), 0) + 1
        return counts

    def right_by_truth(self) -> dict[str, Proportion]:
        """Proportion of right answers, by truth as in the rows of `confusion`."""
        found: dict[str, list[bool]] = {}
        for c in self.cases:
            found.setdefault(_truth(c), []).append(c.right)
        return {name: Proportion.of(flags) for name, flags in found.items()}

    def pairs(self) -> dict[str, int]:
        """The answers where two effects act."""
        counts = dict.fromkeys(
            ("both", "one of them", "one of them and another", "unknown", "none", "others"), 0
        )
        for c in self.cases:
            if c.kind != "pair":
                continue
            named = set(c.causes or ())
            if c.right:
                outcome = "both"
            elif c.causes == ():
                outcome = "none"
            elif c.causes == UNKNOWN:
                outcome = "unknown"
            elif not named & set(c.truth):
                outcome = "others"  # or no answer
            else:
                outcome = "one of them" if named < set(c.truth) else "one of them and another"
            counts[outcome] += 1
        return counts

    def calibration(self) -> tuple[float, tuple[CalibrationBin, ...]]:
        """Expected calibration error of the given answer's probability, and its table."""
        given = [(c.probability, c.right) for c in self.cases]
        known = [(p, right) for p, right in given if p is not None]
        return calibration([p for p, _ in known], [right for _, right in known])

    def causes_found(self) -> dict[str, CausesFound]:
        """True causes found and false ones named, by number of causes and by circumstances."""
        return found_by_group(self.cases)

    def inclusion(self) -> SmoothCalibration | None:
        """Calibration of the probability that each effect is among the causes; None if not stated."""
        return smooth_calibration(inclusions(self.cases))

    def false_alarms(self) -> Proportion:
        """Proportion of campaigns without a gap for which the answer has a cause, including ``unknown``."""
        return Proportion.of([not c.right for c in self.cases if c.kind == "none"])

    def missed(self) -> Proportion:
        """Proportion of campaigns with a gap for which the answer is ``none``."""
        return Proportion.of([c.causes == () for c in self.cases if c.kind != "none"])

    def rivals(self) -> Proportion:
        """Proportion of wrong answers to known effects that name the truth as a possible confusion."""
        wrong = [c for c in self.cases if c.number and not c.right]
        return Proportion.of([c.rival for c in wrong])

    def scatter(self) -> ScatterScore | None:
        """Scatter between runs found; None where no campaign has any and none is named."""
        asked = any(c.widths or c.named_scatter for c in self.cases)
        return scatter_score(self.cases) if asked else None

    def closure(self) -> tuple[Proportion, float, float]:
        """For rightly named campaigns: proportion that closes 0.95 on held-out runs; median and 5th percentile."""
        closed = [c.answer.closed for c in self.cases if c.named_rightly]
        if not closed:
            return Proportion(0, 0), 0.0, 0.0
        return (
            Proportion.of([v >= _CLOSED for v in closed]),
            float(np.median(closed)),
            float(np.quantile(closed, 0.05)),
        )

    def coefficients(self) -> list[CoefficientErrors]:
        """Errors of Cnβ and Cnr before and after, by the outcome of the answer."""
        groups: dict[str, Callable[[Case], bool]] = {
            "named rightly": lambda c: c.named_rightly,
            "none, rightly": lambda c: c.kind == "none" and c.right,
            "unknown, rightly": lambda c: c.right and c.truth == UNKNOWN,
            "wrong": lambda c: not c.right,
            "all": lambda _: True,
        }
        found = []
        for group, belongs in groups.items():
            cases = [c for c in self.cases if belongs(c)]
            for name in NAMES:
                for when in ("before", "after"):
                    errors = [e for c in cases if (e := c.error(name, when)) is not None]
                    if errors:
                        covered = Proportion.of([e.covered for e in errors])
                        spread = float(np.sqrt(np.mean([e.stds**2 for e in errors])))
                        median = float(np.median([abs(e.share) for e in errors]))
                        found.append(CoefficientErrors(group, name, when, covered, spread, median))
        return found

    def seconds(self) -> tuple[float, float, float]:
        """Wall time per campaign, s: median, 90th percentile and largest; zeros where it is not known."""
        times = [c.answer.seconds for c in self.cases if c.answer.seconds is not None]
        if not times:
            return 0.0, 0.0, 0.0
        return float(np.median(times)), float(np.quantile(times, 0.9)), max(times)

    def to_json_dict(self) -> dict[str, Any]:
        """All figures, and every campaign's truth and answer."""
        error, bins = self.calibration()
        share, median, low = self.closure()
        times = self.seconds()
        return {
            "schema_version": 1,
            "sealed": self.sealed,
            "key_sha256": self.key_sha256,
            "answers_sha256": self.answers_sha256,
            "made_with": {} if self.made_with is None else as_json(self.made_with),
            "excluded": list(self.excluded),
            "exact": as_json(self.exact()),
            "confusion": self.confusion(),
            "pairs": self.pairs(),
            "calibration": {"error": error, "bins": as_json(bins)},
            "found": as_json(self.causes_found()),
            "inclusion_calibration": as_json(self.inclusion()),
            "scatter": as_json(self.scatter()),
            "false_alarms": as_json(self.false_alarms()),
            "missed": as_json(self.missed()),
            "rivals_named": as_json(self.rivals()),
            "closure": {"at_least_0.95": share.to_json_dict(), "median": median, "percentile_5": low},
            "coefficients": as_json(self.coefficients()),
            "seconds": dict(zip(("median", "percentile_90", "largest"), times, strict=True)),
            "cases": [
                {"name": c.name, "truth": list(c.truth), "small": list(c.small),
                 "causes": None if c.causes is None else list(c.causes),
                 "probability": c.probability, "right": c.right, "severity": c.stated.severity,
                 "scatter": c.widths, "scatter_named": sorted(c.named_scatter)}
                for c in self.cases
            ],
        }  # fmt: skip


def score_set(
    folder: Path, *, excluded: Sequence[str] = (), key: Path | None = None, effects_file: Path | None = None
) -> BlindScore:
    """Check a set and its answers against their hashes, open the key and combine them.

    A folder without a seal, but with ``truth.json`` in every campaign, is scored as an open set.

    Args:
        excluded: effects withheld when the set was answered.
        key: file of the key; None: the set's own.
        effects_file: file of added effects with which the set was answered; None: none.

    Raises:
        TunnelError: when a campaign is not answered, or when a key, campaign or answer does not match its hash
            or is malformed.
    """
    campaigns = campaign_folders(folder)
    answers, answers_sha256 = _checked_answers(folder, campaigns, excluded, effects_file)
    if (folder / SEAL).exists():
        hashes = read_hashes(folder / SEAL, "campaigns_sha256", "restore it")
        key_sha256 = read_json(folder / SEAL, remedy="restore it").get("key_sha256")
        if set(hashes) != {path.name for path in campaigns}:
            raise TunnelError("campaigns were added or removed", where=str(folder), remedy="restore the set")
        for path in campaigns:
            if folder_hash(path) != hashes[path.name]:
                raise TunnelError("is not the campaign that was sealed", where=str(path), remedy="restore it")
            if answers[path.name].get("data_sha256") != hashes[path.name]:
                raise TunnelError(
                    "was answered from other data",
                    where=str(path),
                    remedy="remove the answers and answer again",
                )
        source = folder / KEY if key is None else key
        document = read_json(source, remedy="name the key with --key")
        if file_hash(source) != key_sha256:
            raise TunnelError(
                "is not the key that was sealed", where=str(source), remedy="name the right one: --key"
            )
        with as_described("is not a key", shown(source), "name the key with --key"):
            truths, given = dict(document["truths"]), document["made_with"]
            made_with = MADE_WITH.validate_python(given) if given else None
    else:
        open_truth = "seal the set (tunnel blind make) or put a truth.json into every campaign"
        truths = {path.name: read_json(path / "truth.json", remedy=open_truth) for path in campaigns}
        key_sha256, made_with = "", None
    cases = []
    for path in campaigns:
        said = scored(answers[path.name], shown(path))
        with as_described("the truth is malformed", shown(path), "name the right key"):
            cases.append(case(path.name, truths[path.name], said, excluded))
    return BlindScore(
        tuple(cases), tuple(sorted(set(excluded))), key_sha256, answers_sha256, made_with, bool(key_sha256)
    )


def _checked_answers(
    folder: Path, campaigns: Sequence[Path], excluded: Sequence[str], effects_file: Path | None
) -> tuple[dict[str, dict[str, Any]], str]:
    """Answers by campaign, and the hash over all."""
    target = answers_folder(folder, excluded, effects_file)
    again = f"answer the set first: tunnel blind diagnose {shown(folder)}" + "".join(
        f" --exclude {e}" for e in excluded
    )
    again += "" if effects_file is None else f" --effects-file {shown(effects_file)}"
    hashes = read_hashes(target / SEAL, "answers_sha256", again)
    unanswered = [path.name for path in campaigns if path.name not in hashes]
    if unanswered:
        raise TunnelError(
            f"{len(unanswered)} of {counted(len(campaigns), 'campaign')} without an answer",
            where=str(target),
            remedy=again,
        )
    answers = {}
    for path in campaigns:
        file = target / f"{path.name}.json"
        answers[path.name] = read_json(file, remedy=again)
        if file_hash(file) != hashes[path.name]:
            raise TunnelError("is not the answer that was given", where=str(file), remedy="restore it")
    return answers, file_hash(target / SEAL)


def _truth(c: Case) -> str:
    return "withheld" if c.withheld else label(c.truth)
