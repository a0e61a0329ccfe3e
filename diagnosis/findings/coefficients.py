"""The coefficients before and after the causes: values, budget, upper limits on undetected effects, and words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Final

from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.hidden import Hidden
from diagnosis.search.answer import UNKNOWN
from identification.printing import COEFFICIENTS, coefficient_label
from identification.show.blocks import TextTable
from identification.show.drawing import AFTER, BEFORE, NARROW
from identification.show.numbers import (
    estimated,
    explained,
    for_people,
    listed,
    percent_of,
    plain,
    relative_change,
    significant,
    size_change,
    unit_mark,
    with_std,
)
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.effects.base import Effect
from tunnel_sim.effects.registry import effect_class, known_effects
from tunnel_sim.vocabulary.dimensions import beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of the nominal model before and after the causes are added.

    Args:
        before: by name: ``cn_beta`` and ``cn_r``; their products with the rig's unstated sizes
            (``cn_beta_area_length``, ``cn_r_area_length2``); ``omega_n`` and ``zeta`` in normalised form; or
            ``yaw_inertia``, ``mechanical_damping`` and ``moment_offset`` of a body without a spring.
        after: by the same names, with the causes added.
        in_phase: with a named lag, ``cn_beta`` and ``cn_r`` in phase with angle and rate; the runs determine
            these better than the coefficients of the law beside the lag. Empty without a named lag.
        covariance: of ``cn_beta`` and ``cn_r`` in ``after``, and of both in ``in_phase``, 1/rad², shape (4, 4);
            empty without a named lag.
        note: the meaning of the coefficients where a cause changes it, as a lag changes that of Cnr; else
            empty.
        correlation: correlation of the coefficients in ``after``, in their order, by the noise of the readings,
            the small causes and the rivals; the other parts of the variances are taken as independent. Shape
            (n, n); empty where it is not known.
    """

    before: Mapping[str, Quantity]
    after: Mapping[str, Quantity]
    in_phase: Mapping[str, Quantity] = field(default_factory=dict)
    covariance: tuple[tuple[float, ...], ...] = ()
    note: str = ""
    correlation: tuple[tuple[float, ...], ...] = ()

    @property
    def comparable(self) -> Mapping[str, Quantity]:
        """The coefficients with the causes that compare with the nominal ones: in phase, where a lag is named."""
        return {**self.after, **self.in_phase}

    def pictures(self) -> tuple[Picture, ...]:
        """The coefficients that the runs determine, before and after; none without any."""
        description = "Coefficients before and after the causes are added, with 95 % intervals."
        drawn = Picture(
            "coefficients", "Estimates with 95 % intervals.", description, partial(coefficients_figure, self)
        )
        return (drawn,) if _determined(self) else ()


def coefficients_table(given: Coefficients, judged: Judged) -> TextTable:
    """The coefficients of the nominal model and, if causes are named, with the causes, and the change of size.

    A terminal shows the 95 % intervals only where one differs from the value ± 1.96 standard deviations.
    """
    before, after = given.before, given.after
    named, rows = judged.names_effects, []
    skewed = any(quantity.interval for quantity in (after or before).values())
    for label, nominal, with_causes in _rows(given):
        best = with_causes or nominal
        cells = [_without_interval(quantity) for quantity in ([nominal, with_causes] if named else [best])]
        interval = _interval(best)
        if skewed and best is not None and best.std:
            cells[-1] += f"\n({interval})"
        change = "–"
        both = [quantity for quantity in (nominal, with_causes) if quantity and quantity.determined]
        if len(both) == 2 and both[0].value:
            change = size_change(*(quantity.value for quantity in both))
        rows.append((label, *cells, *[interval] * (not skewed), *[change] * named))
    causes = "with the causes" if judged.decided else f"with the {judged.set_out}"
    detail = () if skewed else ("95 % interval",)
    first = "without the causes" if named else "estimate"
    heads = ("coefficient", first, *[causes] * named, *detail, *["change of size"] * named)
    title = "Coefficients ± one standard deviation" + " (95 % interval)" * skewed
    return TextTable(title, heads, tuple(rows), right=heads[1:], detail=detail)


def _rows(given: Coefficients) -> Iterator[tuple[str, Quantity | None, Quantity | None]]:
    """Label of a coefficient, and its estimates by the nominal model and with the causes.

    With a named lag the nominal coefficients compare with the derivatives in phase: the nominal model has no
    lag.
    """
    before, after = given.before, given.after
    phase = given.in_phase
    for name in dict.fromkeys([*before, *after]):
        nominal, with_causes = before.get(name), after.get(name)
        label = coefficient_label(name, {**after, **before}[name].unit)
        if name in phase:
            which = "angle" if name.startswith("cn_beta") else "rate"
            yield f"{label}, in phase with the {which}", nominal, phase[name]
            yield f"{label}, beside the lag", None, with_causes
        else:
            yield label, nominal, with_causes


def _without_interval(given: Quantity | None) -> str:
    return "–" if given is None else estimated(replace(given, interval=None))


def _interval(given: Quantity | None) -> str:
    """The central interval of 0.95, with as many digits as its width allows."""
    if given is None or not given.std:
        return "–"
    width = with_std(given.value, INTERVAL * given.std).partition("± ")[2]
    places = len(width.partition(".")[2]) if width.replace(".", "").isdigit() else None
    return " to ".join(significant(end) if places is None else f"{end:.{places}f}" for end in given.ends)


SOURCES = {
    "noise": "noise of the readings",
    "scatter": "scatter between the runs",
    "misfit": "model error",
    "small causes": "small causes that are not named",
    "air density": "rounding of the stated air density",
    "unseen form": "form of the cause that these runs cannot show",
    "freed form": "freedom of the causes' forms",
    "rivals": "other answers, weighted by probability",
}
"""The sources of a coefficient's variance."""


def budget_table(given: Coefficients) -> TextTable:
    """The uncertainty budget of the coefficients of the answer; no rows where the document has no shares.

    A row for each source: its standard deviation and its share of the variance, by coefficient.
    """
    heads: list[str] = []
    columns = [[*SOURCES.values(), "combined standard deviation"]]
    for name, one in given.after.items():
        std, shares = one.std, one.shares
        if std is None or not shares:
            continue
        heads.append(coefficient_label(name, one.unit))
        cells = []
        for part in (shares.get(source, 0.0) for source in SOURCES):
            shown = f"{significant(std * math.sqrt(part), 2)} ({100.0 * part:.1f} %)"
            cells.append("–" if part < 5e-4 else shown)
        columns.append([*cells, significant(std, 2)])
    title = "Uncertainty budget with the causes: standard deviation by source, and share of the variance"
    rows = tuple(zip(*columns, strict=True)) if heads else ()
    return TextTable(title, ("source", *heads), rows, right=tuple(heads))


def coefficients_line(given: Coefficients) -> str:
    """The part of the coefficients' standard deviations that ``identify`` does not include, by source.

    Empty if there is no such part.
    """
    after = {name: quantity for name, quantity in given.after.items() if quantity.std}
    if not after:
        return ""
    parts = []
    for source, words in SOURCES.items():
        shares = {name: quantity.shares.get(source, 0.0) for name, quantity in after.items()}
        if max(shares.values()) >= _COUNTS:
            mostly = listed(
                [COEFFICIENTS.get(name, name) for name, share in shares.items() if share > _MOST] or [""]
            )
            parts.append(f"{words} (most of the variance of {mostly})" if mostly else words)
    if not parts:
        return ""
    if all(quantity.shares.keys() <= {"noise", "scatter", "air density"} for quantity in after.values()):
        return f"± is the ± of tunnel identify; it includes {listed(parts)}."
    return (
        f"± includes {listed(parts)}. The ± of tunnel identify includes the noise, the scatter between runs and "
        "the misfit of its model, so it may be far smaller or larger."
    )


_COUNTS = 0.005  # share of a variance: a smaller one changes no digit of its root
_MOST = 0.5  # share of a variance: it exceeds all other sources together


def hidden_table(hidden: Sequence[Hidden], given: Coefficients) -> TextTable:
    """Upper limits on undetected effects, and the change of each coefficient at that size."""
    rows = []
    moves = next((one.moves for one in hidden if one.moves), {})
    names = [name for name in given.after if name in moves]
    for one in hidden:
        cells = [significant(one.moves[name].value, 2) if one.moves else "–" for name in names]
        rows.append((plain(one.effect), _limit(one, one.size.value), *cells))
    heads = [f"would change {coefficient_label(name, moves[name].unit)} by" for name in names]
    units = explained({one.size.unit for one in hidden if one.size.determined})
    title = f"Upper limits on undetected effects (95 %), which ± does not include{units}"
    return TextTable(title, ("effect", "at most", *heads), tuple(rows), ("at most", *heads))


def _limit(one: Hidden, value: float) -> str:
    """The largest size of an undetected effect, with its unit; relative changes in per cent."""
    if not one.size.determined:
        return "not determined"
    infos = (kind.parameters()[0] for kind in known_effects() if kind.name == one.effect)
    if one.size.unit == "1" and any(info.relative for info in infos):
        return percent_of(value)
    return f"{significant(value, 2)}{unit_mark(beside(one.size.unit))}"


def hidden_line(hidden: Sequence[Hidden], given: Coefficients) -> str:
    """The undetected effects that would change a coefficient by more than its ±; empty if there are none.

    Named are the effect with the greatest change relative to the ±, and each effect that states how to read the
    coefficients without it.
    """
    after, general_form = given.after, Effect.undetected
    clauses: list[tuple[bool, str]] = []
    for hidden_effect in hidden:
        moved = []
        for name, own in after.items():
            move = hidden_effect.moves.get(name)
            if move is not None and own.std and move.value > own.std:
                by = f"{significant(move.value, 2)} {'' if own.unit == '1' else unit_mark(own.unit)}"
                moved.append((COEFFICIENTS.get(name, name), by.strip()))
        form = next(
            (kind.undetected for kind in known_effects() if kind.name == hidden_effect.effect), general_form
        )
        template = form if moved else ""
        general = template == general_form
        if not moved or (general and any(is_general for is_general, _ in clauses)):
            continue
        size = _limit(hidden_effect, abs(hidden_effect.size.value))
        changes = " and ".join(f"{label} by {by}" for label, by in moved) if general else moved[-1][1]
        words = {"effect": plain(hidden_effect.effect), "size": size + explained({hidden_effect.size.unit})}
        clause = template.format(changes=changes, **words)
        clauses.append((general, f"{clause[0].upper()}{clause[1:]}."))
    return f"Upper limits: {' '.join(clause for _, clause in clauses)}" if clauses else ""


def consequence(given: Coefficients, judged: Judged) -> str:
    """Change of the coefficients by the causes, in a sentence, such as ``Cnβ falls by 9 % (0.590 → 0.537)``.

    Empty where no coefficient is known before and after, or no cause is named.
    """
    clauses = []
    if not judged.causes or judged.causes == UNKNOWN:
        return ""
    phase = given.in_phase
    for name, before in given.before.items():
        after = given.comparable.get(name)
        if after is None or not before.value or not (before.determined and after.determined):
            continue
        label = COEFFICIENTS.get(name, name)
        if after.std is not None and after.std > UNCERTAIN_FROM * abs(after.value):
            clauses.append(
                f"{label} remains uncertain ({for_people(after.value, after.std, unit_mark(after.unit))})"
            )
            continue
        label = f"the size of {label}" if before.value < 0.0 and after.value < 0.0 else label
        share = 100.0 * relative_change(before.value, after.value)
        values = _apart(before.value, after.value)
        if before.value * after.value < 0.0:
            clauses.append(f"{COEFFICIENTS.get(name, name)} changes its sign ({values})")
        elif abs(after.value - before.value) < UNCHANGED * abs(before.value):
            clauses.append(f"{label} changes by less than 1 %")
        else:
            size = f"{abs(share):{'.2g' if abs(share) < 0.995 else '.0f'}} %"
            clauses.append(f"{label} {'falls' if share < 0.0 else 'rises'} by {size} ({values})")
    if not clauses:
        return ""
    text = listed(clauses)
    first = text[0].upper() if text[0].isascii() else text[0]  # a Greek letter is a symbol
    return f"{first}{text[1:]}.{_of_the_rate(given) if phase else ''}"


def _of_the_rate(given: Coefficients) -> str:
    """A sentence on the two parts of Cnr in phase with the rate."""
    name = next(name for name in given.in_phase if name.startswith("cn_r"))
    whole, own = given.in_phase[name], given.after[name]
    lag = _digits(whole.value - own.value, 3)
    both = (estimated(replace(one, interval=None)).replace("-", "−") for one in (whole, own))
    return " Of Cnr in phase with the rate, {}, the lag contributes {lag} and the rate itself {}.".format(
        *both, lag=lag
    )


UNCHANGED: Final = 0.005
"""Minimum change of a coefficient, as a share of its value without the causes, that is stated with its size.
Convention. A smaller change rounds to less than 1 %."""
UNCERTAIN_FROM: Final = 0.5
"""Standard deviation of a coefficient, as a share of its value, above which its change is not stated.
Convention."""


def _apart(before: float, after: float) -> str:
    """Two coefficients to three digits, or to as many as distinguish them."""
    for digits in range(3, 7):
        one, two = _digits(before, digits), _digits(after, digits)
        if one != two:
            break
    return f"{one} → {two}"


def _digits(value: float, digits: int) -> str:
    return f"{'−' if value < 0.0 else ''}{significant(abs(value), digits)}"


def coefficient_note(given: Coefficients, judged: Judged) -> str:
    """Notes on the coefficients: their changed meaning under a cause, and the effect of unstated sizes."""
    if judged.cycling:
        return _NO_DECAY
    before = given.before
    caveats = [effect_class(name).caveat for name in judged.causes if name != "unknown"]
    beta = next((name for name in before if name.startswith("cn_beta")), "")
    return " ".join(filter(None, (*caveats, size_note(beta))))


_NO_DECAY = "no damping ratio and no derivative is stated, since no run is a free decay"


def size_note(beta: str) -> str:
    """The quantities identified in place of the coefficients where sizes are not stated.

    Args:
        beta: name of the quantity in place of Cnβ, such as ``cn_beta_area_length``; empty without wind.

    Returns:
        A sentence; empty where the sizes are stated.
    """
    area, length = "_area" in beta, "_length" in beta
    missing = ["frontal_area"] * area + ["reference_length"] * length
    if not missing:
        return ""
    return (
        f"[rig] states no {' and no '.join(missing)}, so Cnβ{'·A' * area}{'·l' * length} and Cnr{'·A' * area}"
        f"{'·l²' * length} are identified, not Cnβ and Cnr. State {'both' if len(missing) > 1 else 'it'} to get "
        "Cnβ and Cnr."
    )


def _determined(given: Coefficients) -> list[str]:
    """Names of the coefficients that the runs determine before and after."""
    before, after = given.before, given.after
    return [name for name in before if name in after and before[name].determined and after[name].determined]


@styled
def coefficients_figure(given: Coefficients) -> Figure:
    """The coefficients that the runs determine, before and after, with 95 % intervals."""
    before, after = given.before, given.after
    names = _determined(given)
    fig = figure(NARROW, 0.3 + 1.3 * len(names))
    for place, name in enumerate(names, 1):
        axes = fig.add_subplot(len(names), 1, place)
        for row, (values, colour, marker) in enumerate(((before, BEFORE, "s"), (after, AFTER, "o"))):
            std = values[name].std
            axes.errorbar(
                values[name].value, row, xerr=None if std is None else INTERVAL * std, color=colour,
                marker=marker, ms=6, capsize=4,
            )  # fmt: skip
        axes.set_yticks([0, 1], ["before", "after"])
        axes.set(ylim=(1.6, -0.6), xlabel=coefficient_label(name, before[name].unit))
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig
