"""A diagnosis in sections of blocks, from its findings: the content of every presentation.

A terminal, ``print``, a notebook and the bench show the sections without their details (`printed`); the report
shows all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from diagnosis.findings.candidates import (
    candidates_pictures,
    candidates_table,
    inclusion_line,
    parameters_table,
)
from diagnosis.findings.cards import cause_cards, effect_cards
from diagnosis.findings.closure import (
    closure_pictures,
    model_line,
    noise_line,
    runs_table,
    tests_table,
    waterfall_pictures,
    waterfall_table,
)
from diagnosis.findings.coefficients import (
    budget_table,
    coefficients_line,
    coefficients_table,
    hidden_line,
    hidden_table,
)
from diagnosis.findings.finding import Picture
from diagnosis.findings.fit_view import fit_pictures
from diagnosis.findings.head import Head
from diagnosis.findings.next_steps import next_steps, rival_lines
from diagnosis.findings.patch import patch_line, patch_table
from diagnosis.findings.place import lines_table, place_pictures, place_rows, where_pictures
from diagnosis.findings.remainder import (
    closable_line,
    closable_table,
    closable_title,
    formula_line,
    law_pictures,
)
from diagnosis.findings.symbols import symbol_rows
from diagnosis.findings.terms import named_answer
from diagnosis.findings.whole import SCHEMA_VERSION, Findings
from identification.printing import COEFFICIENTS, trade_off_line
from identification.show.blocks import (
    Block,
    Detail,
    Figure,
    Heading,
    Listing,
    Pairs,
    Paragraph,
    Section,
    TextTable,
    brief,
)
from identification.show.numbers import held_out_excess, probability, share, significant
from tunnel_sim.vocabulary.campaign import Campaign

EFFECT_LISTED: Final = 0.01
"""Minimum probability of an effect in the list of causes. Judgement."""


def sections(answer: Findings, campaign: Campaign | None = None) -> tuple[Section, ...]:
    """The sections of the whole answer.

    Args:
        campaign: the campaign, if the sections are to state the conditions of its runs.
    """
    blown = bool(campaign.in_wind) if campaign else answer.windy
    found = _sections(answer, campaign, blown=blown)
    return answer.freedom.texts(found, answer.names, answer.motion_scale)


def _sections(answer: Findings, campaign: Campaign | None, *, blown: bool) -> tuple[Section, ...]:
    listed = (
        Head.of(answer).section,
        Section("answer", "The answer", (Paragraph(str(answer.verdict)),)),
        _where(answer),
        _which(answer),
        _causes(answer),
        _place(answer),
        _closes(answer),
        Section("fit", "The fit over the data", figures(fit_pictures(answer.maps))),
        _repeats(answer),
        _how_far(answer, campaign),
        _closable(answer),
        _coefficients(answer),
        _uncertainty(answer, blown),
        _patch(answer),
        Section(
            "cautions",
            "Caveats",
            (Listing(tuple(_caveats(answer)), "Caveats"),),
        ),
        Section(
            "blind",
            "What these runs cannot show",
            (Listing(tuple(answer.blind_spots), "These runs cannot show"),),
        ),
        _provenance(answer),
        Section(
            "next",
            "What to do next",
            (Listing(tuple(next_steps(answer)), "What to do next", numbered=True),),
        ),
    )
    own: dict[str, list[Section]] = {}
    for one in answer.findings.values():
        own.setdefault(one.after, []).append(one.section(answer))
    return tuple(section for one in listed for section in (one, *own.get(one.key, ())))


def printed(answer: Findings) -> tuple[Block, ...]:
    """The blocks of a presentation without room for details, in order."""
    return tuple(block for section in sections(answer) for block in brief(section.blocks))


def _place(answer: Findings) -> Section:
    return Section("place", "Where the gap is", figures(place_pictures(answer.maps, answer)))


def _closes(answer: Findings) -> Section:
    drawn = waterfall_pictures(answer.waterfall, answer.maps, answer)
    return Section("closes", "How much of the gap is explained", figures(drawn))


def _where(answer: Findings) -> Section:
    drawn = figures(where_pictures(answer.where, answer.maps))
    place = (Detail((Pairs(place_rows(answer.where, answer)),)),) if answer.causes else ()
    words = Paragraph(answer.where.words, "Where")
    return Section(
        "where",
        "Where the model departs from the runs",
        (words, *place, *drawn, Detail((lines_table(answer.maps, answer.misfit.unit),))),
    )


def _which(answer: Findings) -> Section:
    return Section(
        "which",
        "Which effect causes it",
        (
            *figures(candidates_pictures(answer.candidates)),
            candidates_table(answer.candidates, answer.repeated, answer),
            Paragraph(inclusion_line(answer.inclusion, EFFECT_LISTED)),
            *(Paragraph(line) for line in rival_lines(answer)),
            *effect_cards(answer),
            *figures(answer.friction.pictures() if answer.friction else ()),
        ),
    )


def _causes(answer: Findings) -> Section:
    cards = cause_cards(answer)
    title = "The cause" if len(cards) == 1 else "The causes"
    if not answer.decided:
        title += f" of the {answer.set_out}"
    return Section(
        "found",
        title,
        (*cards, parameters_table(answer.candidates[0], answer.repeated, answer, answer.found.choices))
        if cards
        else (),
    )


def _repeats(answer: Findings) -> Section:
    line = answer.repeated.line(answer)
    drawn = () if not line or answer.repeated.repeats(answer) else figures(answer.repeated.pictures())
    return Section("repeats", "How the runs repeat", (Paragraph(line), *drawn, answer.repeated.table(answer)))


def _how_far(answer: Findings, campaign: Campaign | None) -> Section:
    drawn = figures(closure_pictures(answer.gap, answer.maps))
    meaning = (
        "A run shows the gap if its residual, with the nominal model fitted to all runs, exceeds chance at a "
        "false-alarm rate of 1 % per campaign and is at least a tenth of the largest residual of a run."
    )
    runs = runs_table(answer.gap, answer.where.runs, answer, campaign)
    return Section(
        "how-far-section",
        "How much of the gap is explained, run by run",
        (
            waterfall_table(answer.waterfall, answer.misfit),
            *drawn,
            runs,
            Detail((Paragraph(meaning, kind="small"),)),
        ),
    )


def _closable(answer: Findings) -> Section:
    drawn = figures(law_pictures(answer.closable, answer.misfit.unit))
    return Section(
        "closable",
        closable_title(answer),
        (
            Paragraph(closable_line(answer.closable, answer.rest, answer)),
            closable_table(answer.closable, answer),
            Paragraph(formula_line(answer.closable, answer)),
            *drawn,
        ),
    )


def _coefficients(answer: Findings) -> Section:
    given = answer.coefficients
    fitted = (name for candidate in answer.candidates[:1] for name in candidate.parameters)
    table = coefficients_table(given, answer)
    symbols = symbol_rows(answer.causes, {**given.before, **given.after}, fitted)
    title = "Coefficients before and after" if "change of size" in table.columns else "Coefficients"
    nothing = () if table.rows else (Detail((Paragraph("These runs give no coefficients."),)),)
    return Section(
        "coefficients-section",
        title,
        (
            table,
            *nothing,
            Paragraph(answer.coefficients.note, "Note"),
            Detail((Pairs(tuple(symbols)),), "What the symbols mean"),
        ),
    )


def _uncertainty(answer: Findings, blown: bool) -> Section:
    stated = (
        "spring stiffness, wind speed, air density, area and length"
        if blown
        else "the stated conditions, such as the spring stiffness"
    )
    beyond = Paragraph(
        f"Not in the budget: the uncertainties of {stated}, which are taken as stated. "
        "tunnel identify --budget --uncertainties FILE adds them.",
        kind="small",
    )
    return Section(
        "uncertainty",
        "Uncertainty of the coefficients",
        (
            *figures(answer.coefficients.pictures()),
            Detail((budget_table(answer.coefficients),)),
            Paragraph(coefficients_line(answer.coefficients)),
            Paragraph(trade_off_line(answer.trade_off, COEFFICIENTS)),
            Paragraph(hidden_line(answer.hidden, answer.coefficients)),
            Detail((hidden_table(answer.hidden, answer.coefficients), beyond)),
        ),
    )


def _patch(answer: Findings) -> Section:
    notes = () if answer.model is None else answer.model.notes
    title = "Differences between the elements of the model and the law of the fit"
    return Section(
        "patch",
        "The model with the causes",
        (
            Paragraph(patch_line(answer.model, answer)),
            Listing(tuple(notes), title),
            patch_table(answer.model),
        ),
    )


def _caveats(answer: Findings) -> Iterator[str]:
    for remark in answer.remarks:
        yield str(remark)
    yield from answer.cautions


def _provenance(answer: Findings) -> Section:
    provenance = answer.provenance or {}
    versions = (
        *provenance.get("versions", {}).items(),
        ("schema of the document", str(SCHEMA_VERSION)),
    )
    hashes = tuple(provenance.get("sha256", {}).items())
    seconds = tuple((name, f"{value:.1f} s") for name, value in answer.seconds.items())
    alarms = significant(answer.gap.false_alarm_rate, 2)
    tests = tests_table(answer.gap)
    false = (
        f"All tests together raise a false alarm in {alarms} of the campaigns without a gap."
        if tests.rows
        else ""
    )
    return Section(
        "provenance",
        "Tests, noise and provenance",
        (
            Detail((tests, Paragraph(false, kind="small"))),
            Paragraph(noise_line(answer.noise, answer.misfit.unit)),
            Paragraph(model_line(answer.confirmation, answer.misfit.unit)),
            Detail(
                (
                    Heading("Units and terms"),
                    Pairs(TERMS),
                    TextTable("Versions", ("of", "version"), versions),
                    TextTable("Records", ("file", "SHA-256"), hashes),
                    TextTable("Time taken", ("step", "time"), seconds, right=("time",)),
                )
            ),
        ),
    )


TERMS = (
    ("Units", "SI; angles of the readings in degrees, coefficients and parameters in radians"),
    (
        "Misfit",
        "root mean square of the residual beyond the noise: the noise of a sample times the root of the excess; "
        "the swing is the root mean square of the readings",
    ),
    (
        "Excess",
        "mean squared residual over the noise variance of a sample, minus one: 0 is a perfect model, 1 a residual "
        "with twice the noise variance",
    ),
    (
        "Held out",
        "runs or stretches of time that were left out of the fit and then predicted; only their release is fitted",
    ),
    ("±, σ", "one standard deviation; intervals are 95 %"),
)
"""Units and terms of the report."""


def diagnosis_brief(answer: Findings) -> str:
    """An answer in three lines: its causes, its gap, and the next step."""
    gap, first = answer.gap, answer.candidates[0]
    causes = answer.causes
    named = named_answer(causes).lower() if causes else "no gap"
    decided = answer.decided
    undecided = "" if decided else f"undecided, the {answer.set_out} is "
    misfit, excess = answer.misfit, gap.excess_before
    size = (
        f"{misfit.rms_words(excess)} root mean square, {misfit.swing_words(excess)} "
        f"({held_out_excess(excess)} times the noise variance)"
    )
    closed = f"; {share(gap.closed)} explained {gap.closed_on}" if answer.names_effects else ""
    likely = probability(first.probability)
    return answer.freedom.words(
        f"Diagnosis of {answer.campaign!r}: {undecided}{named} (probability {likely})\n"
        f"  gap {size}{closed}\n"
        "  print() shows all; .plot(), .write_report(path), .to_frame()",
        answer.names,
    )


def figures(pictures: Iterable[Picture]) -> tuple[Figure, ...]:
    """Pictures in a section."""
    return tuple(one.block for one in pictures)
