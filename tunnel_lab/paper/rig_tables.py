"""Tables I and II, the equations, and Figs 1 and 2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, log, pi, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification import identify
from identification.campaign.springs import SpringFit, fit_springs
from identification.datasets import SpringRow, paper_springs
from identification.show.numbers import concise, with_std
from identification.show.style import BLUE, COLOURS, VERMILION, WIDTH, figure, grid, save_both, styled
from identification.signal.free_decay import Decay, free_decay
from tunnel_lab.paper.networks import paper_run_plan
from tunnel_lab.paper.paper_page import PaperPicture, PaperSection, scaled, signed
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TABLE_I = (
    ("width", "m", 0.225), ("height", "m", 0.160), ("length", "m", 0.625), ("ground clearance", "m", 0.040),
    ("frontal area", "m²", 0.036), ("side area", "m²", 0.063), ("mass", "kg", 4.689),
)  # fmt: skip
TABLE_I_INERTIA = 0.11  # kg m²
_DURATION = 40.0  # s: twenty cycles of the softest spring
_DRAWN_ZETA = (0.01, 0.05, 0.1, 0.35)
_PRINTED_ZETA = 0.1
LN2 = log(2.0)


def table_1(_: Path) -> PaperSection:
    """The model's sizes."""
    rig = load_rig()
    rows = [
        (name, unit, f"{theirs:g}", f"{getattr(rig.body, name.replace(' ', '_')):g}")
        for name, unit, theirs in TABLE_I
    ]
    rows.append(("yaw inertia Izz", "kg m²", f"{TABLE_I_INERTIA:g}", f"{rig.dynamics.yaw_inertia:g}"))
    return PaperSection(
        title="Table I",
        about="sizes of the model",
        theirs="Izz 0.11 kg m²",
        ours=f"the same sizes; Izz {rig.dynamics.yaw_inertia:g} kg m²",
        outcome="corrected",
        words=(
            "The virtual rig has the sizes of Table I and the inertia of Table II, because the paper "
            "itself defines the inertia as the gradient of Kr (eq. 1). All coefficients scale with it: "
            "with 0.11 kg m² Cnβ and Cnr would be "
            f"{100.0 * (TABLE_I_INERTIA / rig.dynamics.yaw_inertia - 1.0):.1f} % larger in eqs 17 and 18.",
        ),
        headings=("", "unit", "paper", "virtual rig"),
        rows=tuple(rows),
    )


def table_2(folder: Path) -> PaperSection:
    """Springs, frequencies and the inertia; this project's values are from wind-off runs of the virtual rig."""
    from tunnel_sim import simulate_campaign

    springs = paper_springs()
    stiffness = [spring.stiffness_n_m_per_rad for spring in springs]
    theirs = fit_springs(stiffness, [spring.frequency_hz for spring in springs])
    # A wind-off run of every spring.
    plan = paper_plan()
    off = next(condition for condition in plan.conditions if condition.wind_speed == 0.0)
    conditions = tuple(
        replace(off, id=f"spring-{number}", spring_stiffness=value, duration=_DURATION)
        for number, value in enumerate(stiffness, 1)
    )
    campaign = simulate_campaign(replace(plan, name="springs", conditions=conditions))
    runs = identify(campaign, "conventional", throw=False).runs
    frequencies = [scaled(run.omega_n, 1.0 / (2.0 * pi)) for run in runs]
    kept = [
        (frequency.value, value)
        for frequency, value in zip(frequencies, stiffness, strict=True)
        if frequency is not None
    ]
    ours = fit_springs([value for _, value in kept], [frequency for frequency, _ in kept])
    rows = tuple(
        (
            str(spring.number), f"{spring.stiffness_n_m_per_rad:g}", f"{spring.frequency_hz:g}",
            "–" if frequency is None else concise(frequency.value, frequency.std), signed(residual, 1),
            "off the line" if flag else "",
        )
        for spring, frequency, residual, flag in zip(
            springs, frequencies, theirs.residual_percent, theirs.flagged, strict=True
        )
    )  # fmt: skip
    save_both(springs_figure(springs, theirs, TABLE_I_INERTIA), folder / "springs.png")
    odd = ", ".join(str(spring.number) for spring, flag in zip(springs, theirs.flagged, strict=True) if flag)
    return PaperSection(
        title="Table II",
        about="springs and wind-off frequencies; the inertia (eq. 1)",
        theirs=f"gradient {with_std(theirs.inertia.value, theirs.inertia.std)} kg m²; Table I says 0.11",
        ours=f"{with_std(ours.inertia.value, ours.inertia.std)} kg m² from simulated runs of the same springs",
        outcome="corrected",
        words=(
            "The gradient of Kr against ωn² of Table II is not the 0.11 kg m² of Table I. The text says "
            "that Kr is plotted against ωn; the gradient is an inertia only against ωn².",
            f"Springs beyond chance off the line: {odd or 'none'}. No inertia moves one spring and not the "
            "next, so their stiffness or frequency is wrong, or they are of another kind. The virtual rig "
            "takes the stiffnesses as stated; its frequencies follow from one inertia and differ from "
            "the paper's by as much.",
        ),
        headings=(
            "spring",
            "Kr [N m/rad]",
            "f, paper [Hz]",
            "f, simulated [Hz]",
            "Kr against the line [%]",
            "",
        ),
        rows=rows,
        pictures=(
            PaperPicture(
                file="springs.png", caption="Table II with its line, and the residuals of the springs."
            ),
        ),
    )


def equations(_: Path) -> PaperSection:
    """The slips in the printed equations, and their results for a known truth."""
    known = known_run()
    beta = known.cn_beta_of(eq7(known.on, known.off))
    right, wrong = (known.cn_r_of(eq8(known.on, known.off, printed=printed)) for printed in (False, True))
    zeta = known.on.rate / known.on.omega_n
    turned = printed_transfer_function(zeta, known.on.omega_n)
    truth = f"Cnβ {signed(known.cn_beta, 4)}, Cnr {signed(known.cn_r, 4)}"
    undamped = (
        f"no damping at all (ζ 0 for {zeta:.4f}), at {turned.omega_n:.3f} for {known.on.omega_n:.3f} rad/s"
    )
    rows = (
        ("text after 6", "N̂β = −Ka/Izz, N̂r = −Ca/Izz", "N̂β = +Ka/Izz, N̂r = +Ca/Izz",
         f"Cnβ {signed(-known.cn_beta, 4)}, Cnr {signed(-known.cn_r, 4)}: both signs reversed"),
        ("7", "as it should be", "ωn² = ωd² + σ², σ = ln 2/t½", f"Cnβ {signed(beta, 4)}: right"),
        ("8", "1/t½² − 1/t½₀", "1/t½ − 1/t½₀", f"Cnr {signed(wrong, 4)}; corrected: {signed(right, 4)}"),
        ("9", "s² + 2ζωn + ωn² = Δs", "characteristic polynomial s² + 2ζωn s + ωn²", "the units do not agree"),
        ("12", "2ζωn in the denominator", "2ζωn s", undamped),
        ("16", "2ζωn in the denominator", "2ζωn s in the denominator; the numerator is right", undamped),
    )  # fmt: skip
    return PaperSection(
        title="Equations 6 to 18",
        about="slips of the printed equations",
        theirs="eqs 8, 9, 12 and 16 and the text after eq. 6 as printed",
        ours="corrected; the paper's results cannot come from eqs 8 and 12 as printed",
        outcome="corrected",
        words=(
            f"The truth of this example is {truth} 1/rad, of spring 5 at 10 m/s (an inference). The last "
            "column applies each equation as printed. N̂β and N̂r lead to Cnβ and Cnr by eqs "
            "17 and 18.",
            "Eq. 8 as printed gives even the wrong sign. The paper's Cnr is negative in both columns of "
            "Table IV, so it cannot have been computed so.",
        ),
        headings=("equation", "printed", "right", "the printed one gives"),
        rows=rows,
    )


def figure_1(folder: Path) -> PaperSection:
    """The rig."""
    from tunnel_lab.show.film import Look, write_film
    from tunnel_lab.show.request import Request

    words = "The paper shows a photograph. This is the virtual rig of the same sizes."
    pictures: tuple[PaperPicture, ...] = ()
    try:
        write_film(Request(), Look(height=600, trace=False), folder / "rig.png", at=0.0)
        pictures = (
            PaperPicture(
                file="rig.png", caption="The virtual rig: the Davis model on its rod, yawed by 20°."
            ),
        )
    except TunnelError as error:
        words += f" It could not be drawn here: {error}."
    return PaperSection(
        title="Fig. 1",
        about="the model in the working section",
        theirs="a photograph",
        ours="the virtual rig",
        outcome="in part",
        words=(words,),
        pictures=pictures,
    )


def figure_2(folder: Path) -> PaperSection:
    """Impulse responses."""
    save_both(impulse_figure(), folder / "impulse.png")
    return PaperSection(
        title="Fig. 2",
        about="impulse response over ωn t, and the three cycles that the first network gets",
        theirs="one curve",
        ours="the same from the closed form; eq. 12 as printed never decays",
        outcome="reproduced",
        words=(
            "Over ωn t the response depends on ζ alone, but the instants at which three cycles are "
            "complete depend on ζ too. The networks here divide the record at its zero crossings instead, "
            "so that ωn need not be known.",
        ),
        pictures=(
            PaperPicture(file="impulse.png", caption="Impulse responses, scaled to a largest value of 1."),
        ),
    )


@styled
def springs_figure(springs: Sequence[SpringRow], fit: SpringFit, stated: float) -> Figure:
    """The springs with the fitted line, and the deviation of each.

    Args:
        springs: springs of Table II.
        fit: line through the same springs.
        stated: inertia in Table I, kg m².
    """
    fig = figure(WIDTH, 2.9)
    left, right = fig.subplots(1, 2)
    square = np.array([(2.0 * np.pi * spring.frequency_hz) ** 2 for spring in springs])
    stiffness = np.array([spring.stiffness_n_m_per_rad for spring in springs])
    ends = np.array([0.0, 1.03 * square.max()])
    left.plot(square, stiffness, "o", color=BLUE, ms=4, label="Table II")
    left.plot(
        ends,
        fit.inertia.value * ends + fit.intercept.value,
        color=BLUE,
        label=f"gradient {fit.inertia.value:.4f} kg m²",
    )
    left.plot(ends, stated * ends, "--", color=VERMILION, label=f"Table I: {stated:g} kg m²")
    left.set(xlabel="ωn² [rad²/s²]", ylabel="stiffness Kr [N m/rad]", xlim=(0.0, ends[1]), ylim=(0.0, None))
    left.legend(loc="upper left")
    numbers = [spring.number for spring in springs]
    right.axhline(0.0, color="0.4", lw=0.8)
    right.vlines(numbers, 0.0, fit.residual_percent, color=BLUE, lw=0.8)
    right.plot(numbers, fit.residual_percent, "o", color=BLUE, ms=4)
    right.set(xlabel="spring", ylabel="stiffness against the line [%]")
    right.set_xticks(numbers)
    for axes in (left, right):
        grid(axes)
    return fig


@styled
def impulse_figure() -> Figure:
    """Fig. 2: impulse responses over ωn t, the largest value 1; one of them also by eq. 12 as printed."""
    fig = figure(WIDTH, 3.0)
    axes = fig.add_subplot()
    time = np.linspace(0.0, 6.6 * np.pi, 1200)
    for zeta, colour in zip(_DRAWN_ZETA, COLOURS, strict=False):
        response = free_decay(time, Decay.from_modal(1.0, zeta), 0.0, 1.0)
        axes.plot(time, response / response.max(), color=colour, label=f"ζ = {zeta:g}")
    wrong = np.sin(printed_transfer_function(_PRINTED_ZETA, 1.0).omega_n * time)
    axes.plot(time, wrong, ":", color="black", lw=1.0, label=f"eq. 12 as printed, ζ = {_PRINTED_ZETA:g}")
    axes.axvspan(0.0, 6.0 * np.pi, color="#e6e9ec", lw=0, zorder=0)
    axes.set(
        xlabel="ωn t [rad]; shaded: three cycles",
        ylabel="response over its largest value",
        xlim=(0.0, time[-1]),
    )
    axes.set_xticks(2.0 * np.pi * np.arange(4), ["0", "2π", "4π", "6π"])
    fig.legend(loc="outside upper center", ncols=5)
    grid(axes)
    return fig


@dataclass(frozen=True)
class Oscillation:
    """A damped oscillation.

    Args:
        omega_n: natural frequency, rad/s.
        rate: decay rate σ, 1/s.
    """

    omega_n: float
    rate: float

    @property
    def frequency(self) -> float:
        """Damped frequency, Hz."""
        return sqrt(self.omega_n**2 - self.rate**2) / (2.0 * pi)

    @property
    def half_time(self) -> float:
        """Time to half amplitude, s."""
        return LN2 / self.rate if self.rate else inf


@dataclass(frozen=True)
class KnownRun:
    """A run of known truth, with the wind off and on.

    Args:
        inertia: Izz, kg m².
        stiffness_load: Ka over Cnβ, N m.
        damping_load: Ca over Cnr, N m s.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
    """

    inertia: float
    stiffness_load: float
    damping_load: float
    cn_beta: float
    cn_r: float
    off: Oscillation
    on: Oscillation

    def cn_r_of(self, normalised: float) -> float:
        """Cnr of eq. 18, 1/rad, from N̂r in 1/s."""
        return normalised * self.inertia / self.damping_load

    def cn_beta_of(self, normalised: float) -> float:
        """Cnβ of eq. 17, 1/rad, from N̂β in 1/s²."""
        return normalised * self.inertia / self.stiffness_load


def known_run() -> KnownRun:
    """Spring 5 at 10 m/s with the paper's coefficients: possibly the run of Table III, an inference."""
    plan, rig = paper_run_plan(1), load_rig()
    truth, on = plan.truth, plan.conditions[1]
    air = rig.body.flow(rig.air.density, on.wind_speed)
    stiffness = float(on.spring_stiffness or 0.0)
    inertia, damping = truth.yaw_inertia, truth.mechanical_damping
    ka, ca = aerodynamic_stiffness(truth.cn_beta, **air), aerodynamic_damping(truth.cn_r, **air)
    return KnownRun(
        inertia, ka / truth.cn_beta, ca / truth.cn_r, truth.cn_beta, truth.cn_r,
        Oscillation(sqrt(stiffness / inertia), damping / (2.0 * inertia)),
        Oscillation(sqrt((stiffness - ka) / inertia), (damping - ca) / (2.0 * inertia)),
    )  # fmt: skip


def eq7(on: Oscillation, off: Oscillation) -> float:
    """N̂β as printed, 1/s²."""
    change = 4.0 * pi**2 * (on.frequency**2 - off.frequency**2)
    return -(change + LN2**2 * (on.half_time**-2 - off.half_time**-2))


def eq8(on: Oscillation, off: Oscillation, *, printed: bool) -> float:
    """N̂r, 1/s; as printed, its first term is squared and has the wrong unit."""
    first = on.half_time**-2 if printed else 1.0 / on.half_time
    return -2.0 * LN2 * (first - 1.0 / off.half_time)


def printed_transfer_function(zeta: float, omega_n: float) -> Oscillation:
    """The oscillation of eqs 12 and 16 as printed, with ``2ζωn`` for ``2ζωn s``.

    Args:
        zeta: damping ratio.
        omega_n: natural frequency, rad/s.

    Returns:
        An oscillation without damping, because the denominator has no term in s. Its ωn² (1/s²) and 2ζωn (1/s)
        are added as numbers in SI.
    """
    return Oscillation(sqrt(omega_n**2 + 2.0 * zeta * omega_n), 0.0)
