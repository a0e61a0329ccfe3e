"""Tables I and II, the equations, and Figs 1 and 2."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

from identification import identify
from identification.campaign.springs import fit_springs
from identification.datasets import paper_springs
from identification.printing.numbers import concise, with_std
from tunnel_lab.paper import figures
from tunnel_lab.paper.equations import eq7, eq8, known_run, printed_transfer_function
from tunnel_lab.paper.section import Picture, Section, scaled, signed
from tunnel_lab.plotting.style import save_both
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan

TABLE_I = (
    ("width", "m", 0.225), ("height", "m", 0.160), ("length", "m", 0.625), ("ground clearance", "m", 0.040),
    ("frontal area", "m²", 0.036), ("side area", "m²", 0.063), ("mass", "kg", 4.689),
)  # fmt: skip
TABLE_I_INERTIA = 0.11  # kg m²
_DURATION = 40.0  # s: twenty cycles of the softest spring


def table_1(_: Path) -> Section:
    """The model's sizes."""
    rig = load_rig()
    rows = [
        (name, unit, f"{theirs:g}", f"{getattr(rig.body, name.replace(' ', '_')):g}")
        for name, unit, theirs in TABLE_I
    ]
    rows.append(("yaw inertia Izz", "kg m²", f"{TABLE_I_INERTIA:g}", f"{rig.dynamics.yaw_inertia:g}"))
    return Section(
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


def table_2(folder: Path) -> Section:
    """Springs, frequencies and the inertia; ours from wind-off runs of the virtual rig."""
    from tunnel_sim import simulate_campaign

    springs = paper_springs()
    stiffness = [spring.stiffness_n_m_per_rad for spring in springs]
    theirs = fit_springs(stiffness, [spring.frequency_hz for spring in springs])
    campaign = simulate_campaign(springs_plan(stiffness))
    runs = identify(campaign, "conventional", throw=False).runs
    found = [scaled(run.omega_n, 1.0 / (2.0 * pi)) for run in runs]
    kept = [(own.value, value) for own, value in zip(found, stiffness, strict=True) if own is not None]
    ours = fit_springs([value for _, value in kept], [own for own, _ in kept])
    rows = tuple(
        (
            str(spring.number), f"{spring.stiffness_n_m_per_rad:g}", f"{spring.frequency_hz:g}",
            "–" if own is None else concise(own.value, own.std), signed(residual, 1),
            "off the line" if flag else "",
        )
        for spring, own, residual, flag in zip(springs, found, theirs.residual_percent, theirs.flagged, strict=True)
    )  # fmt: skip
    save_both(figures.springs_figure(springs, theirs, TABLE_I_INERTIA), folder / "springs.png")
    off = ", ".join(str(spring.number) for spring, flag in zip(springs, theirs.flagged, strict=True) if flag)
    return Section(
        title="Table II",
        about="springs and wind-off frequencies; the inertia (eq. 1)",
        theirs=f"gradient {with_std(theirs.inertia.value, theirs.inertia.std)} kg m²; Table I says 0.11",
        ours=f"{with_std(ours.inertia.value, ours.inertia.std)} kg m² from simulated runs of the same springs",
        outcome="corrected",
        words=(
            "The gradient of Kr against ωn² of Table II is not the 0.11 kg m² of Table I. The text says "
            "that Kr is plotted against ωn; the gradient is an inertia only against ωn².",
            f"Springs beyond chance off the line: {off or 'none'}. No inertia moves one spring and not the "
            "next, so their stiffness or frequency is wrong, or they are of another kind. The virtual rig "
            "takes the stiffnesses as stated; its frequencies are those of one inertia and differ from "
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
            Picture(file="springs.png", caption="Table II with its line, and the residuals of the springs."),
        ),
    )


def springs_plan(stiffness: list[float]) -> CampaignPlan:
    """A wind-off run of every spring.

    Args:
        stiffness: N m/rad.
    """
    plan = paper_plan()
    off = next(one for one in plan.conditions if one.wind_speed == 0.0)
    conditions = tuple(
        replace(off, id=f"spring-{number}", spring_stiffness=value, duration=_DURATION)
        for number, value in enumerate(stiffness, 1)
    )
    return replace(plan, name="springs", conditions=conditions)


def equations(_: Path) -> Section:
    """The slips of the printed equations, and what they give where the truth is known."""
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
    return Section(
        title="Equations 6 to 18",
        about="slips of the printed equations",
        theirs="eqs 8, 9, 12 and 16 and the text after eq. 6 as printed",
        ours="corrected; the paper's results cannot come from eqs 8 and 12 as printed",
        outcome="corrected",
        words=(
            f"The truth of this example is {truth} 1/rad, of spring 5 at 10 m/s (an inference). The last "
            "column is what each equation gives as it is printed. N̂β and N̂r lead to Cnβ and Cnr by eqs "
            "17 and 18.",
            "Eq. 8 as printed gives even the wrong sign. The paper's Cnr is negative in both columns of "
            "Table IV, so it cannot have been computed so.",
        ),
        headings=("equation", "printed", "right", "the printed one gives"),
        rows=rows,
    )


def figure_1(folder: Path) -> Section:
    """The rig."""
    from tunnel_lab.show.film import Look, write_still
    from tunnel_lab.show.request import Request

    words = "The paper shows a photograph. This is the virtual rig of the same sizes."
    pictures: tuple[Picture, ...] = ()
    try:
        write_still(Request(), Look(height=600, trace=False), folder / "rig.png", 0.0)
        pictures = (
            Picture(file="rig.png", caption="The virtual rig: the Davis model on its rod, yawed by 20°."),
        )
    except TunnelError as error:
        words += f" It could not be drawn here: {error}."
    return Section(
        title="Fig. 1",
        about="the model in the working section",
        theirs="a photograph",
        ours="the virtual rig",
        outcome="in part",
        words=(words,),
        pictures=pictures,
    )


def figure_2(folder: Path) -> Section:
    """Impulse responses."""
    save_both(figures.impulse_figure(), folder / "impulse.png")
    return Section(
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
        pictures=(Picture(file="impulse.png", caption="Impulse responses, scaled to a largest value of 1."),),
    )
