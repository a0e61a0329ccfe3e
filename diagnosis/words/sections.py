"""A diagnosis in sections of blocks, from its document: the content of every face.

A terminal, ``print``, a notebook and the bench show the sections without their details (`printed`); the report
shows all of them.
"""

from __future__ import annotations

from collections.abc import Iterator

from diagnosis.words.answers import set_out
from diagnosis.words.captions import captioned
from diagnosis.words.cards import cause_cards, effect_cards
from diagnosis.words.lines import (
    coefficients_line,
    hidden_line,
    inclusion_line,
    model_line,
    noise_line,
    patch_line,
)
from diagnosis.words.numbers import (
    CHANNELS,
    CONDITIONS,
    unit_shown,
    windy,
)
from diagnosis.words.remainder import closable_line
from diagnosis.words.scatter import (
    repeatability_line,
    repeatability_table,
    repeats,
)
from diagnosis.words.symbols import symbol_rows
from diagnosis.words.tables import (
    budget_table,
    candidates_table,
    closable_table,
    coefficients_table,
    hidden_table,
    lines_table,
    parameters_table,
    patch_table,
    runs_table,
    tests_table,
    waterfall_table,
)
from diagnosis.words.verdict import next_steps, rival_lines
from identification.blocks import (
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
from identification.printing import COEFFICIENTS, Document, significant, trade_off_line
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign

_UNDETERMINED = "not shown by the residuals alone"


def sections(document: Document, campaign: Campaign | None = None) -> tuple[Section, ...]:
    """The whole answer.

    Args:
        campaign: adds the conditions of the runs.
    """
    blown = any(run.wind_on for run in campaign.runs) if campaign else windy(document)
    return (
        Section("answer", "The answer", (Paragraph(str(document["verdict"])),)),
        _where(document),
        _which(document),
        _causes(document),
        _place(document),
        _closes(document),
        Section("fit", "The fit over the data", (captioned("fit"),)),
        _repeats(document),
        _how_far(document, campaign),
        _closable(document),
        _coefficients(document),
        _uncertainty(document, blown),
        _patch(document),
        Section("cautions", "Caveats", (Listing(tuple(_caveats(document)), "Caveats"),), opened=True),
        Section(
            "blind",
            "What these runs cannot show",
            (Listing(tuple(document["blind_spots"]), "These runs cannot show"),),
        ),
        _provenance(document),
        Section(
            "next",
            "What to do next",
            (Listing(tuple(next_steps(document)), "What to do next", numbered=True),),
        ),
    )


def printed(document: Document) -> tuple[Block, ...]:
    """The blocks of a face without room for details, in order."""
    return tuple(block for section in sections(document) for block in brief(section.blocks))


def _place(document: Document) -> Section:
    grid = (document.get("maps") or {}).get("grid") or {}
    axis = "the wind speed" if grid.get("wind_speeds") else "time"
    caption = (
        f"Misfit of the nominal model, fitted to all runs, by the amplitude of the motion and {axis}. Empty cells "
        "hold no sample or are within three standard deviations of the noise."
    )
    return Section("place", "Where the gap is", (Figure("place", caption),))


def _closes(document: Document) -> Section:
    caption = (
        "The residual misfit as the causes are added, the largest contribution first, "
        f"{document.get('waterfall_on', '')}. Open circles: the misfit without this cause, the others refitted."
    )
    return Section("closes", "How much of the gap is explained", (Figure("waterfall", caption),))


def _where(document: Document) -> Section:
    figures = (
        captioned("where-runs"),
        captioned("where-profiles"),
        captioned("where-spectrum"),
        captioned("where-backbones"),
        captioned("where-phase-plane"),
        captioned("where-moment"),
    )
    place = (Detail((Pairs(place_rows(document)),)),) if document["causes"] else ()
    words = Paragraph(document["where"]["words"], "Where")
    return Section(
        "where",
        "Where the model departs from the runs",
        (words, *place, *figures, Detail((lines_table(document),))),
    )


def place_rows(document: Document) -> tuple[tuple[str, str], ...]:
    """The place of the gap, field by field."""
    where, degree = document["where"], unit_shown("rad")[1]
    rows = [("Runs that show it", ", ".join(where["runs"]) or "–")]
    for label, key, factor, unit in (
        ("Time", "time_s", 1.0, " s"),
        ("Amplitude", "amplitude_rad", degree, "°"),
        ("Frequency", "frequency_hz", 1.0, " Hz"),
    ):
        ends = [significant(factor * value, 3) for value in where[key] or ()]
        rows.append((label, f"{' to '.join(ends)}{unit}" if ends else "–"))
    rows.append(("Acts on", CHANNELS.get(where["channel"] or "", _UNDETERMINED)))
    if windy(document):
        condition = where["condition"]
        rows.append(("Acts", _UNDETERMINED if condition is None else CONDITIONS[condition]))
    return tuple(rows)


def _which(document: Document) -> Section:
    return Section(
        "which",
        "Which effect causes it",
        (
            captioned("which"),
            candidates_table(document),
            Paragraph(inclusion_line(document)),
            *(Paragraph(line) for line in rival_lines(document)),
            *effect_cards(document),
            captioned("friction"),
        ),
    )


def _causes(document: Document) -> Section:
    cards = cause_cards(document)
    title = "The cause" if len(cards) == 1 else "The causes"
    if not document.get("decided", True):
        title += f" of the {set_out(document)}"
    return Section("found", title, (*cards, parameters_table(document)) if cards else ())


def _repeats(document: Document) -> Section:
    line = repeatability_line(document)
    drawn = [] if not line or repeats(document) else [captioned("repeatability")]
    return Section("repeats", "How the runs repeat", (Paragraph(line), *drawn, repeatability_table(document)))


def _how_far(document: Document, campaign: Campaign | None) -> Section:
    drawn = captioned("how-far")
    meaning = (
        "A run shows the gap if its residual, with the nominal model fitted to all runs, exceeds chance at a "
        "false-alarm rate of 1 % per campaign and is at least a tenth of the largest residual of a run."
    )
    runs = runs_table(document, campaign)
    return Section(
        "how-far-section",
        "How much of the gap is explained, run by run",
        (waterfall_table(document), drawn, runs, Detail((Paragraph(meaning, kind="small"),))),
    )


def _closable(document: Document) -> Section:
    drawn = captioned("law")
    return Section(
        "closable",
        "What could explain the residual gap",
        (Paragraph(closable_line(document)), closable_table(document), drawn),
    )


def _coefficients(document: Document) -> Section:
    table, symbols = coefficients_table(document), symbol_rows(document)
    title = "Coefficients before and after" if "change of size" in table.columns else "Coefficients"
    nothing = () if table.rows else (Detail((Paragraph("These runs give no coefficients."),)),)
    return Section(
        "coefficients-section",
        title,
        (
            table,
            *nothing,
            Paragraph(document["coefficients"]["note"], "Note"),
            Detail((Pairs(tuple(symbols)),), "What the symbols mean"),
        ),
    )


def _uncertainty(document: Document, blown: bool) -> Section:
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
            captioned("coefficients"),
            Detail((budget_table(document),)),
            Paragraph(coefficients_line(document)),
            Paragraph(trade_off_line(document, COEFFICIENTS)),
            Paragraph(hidden_line(document)),
            Detail((hidden_table(document), beyond)),
        ),
    )


def _patch(document: Document) -> Section:
    notes = (document.get("model") or {"notes": ()})["notes"]
    title = "Differences between the elements of the model and the law of the fit"
    return Section(
        "patch",
        "The model with the causes",
        (Paragraph(patch_line(document)), Listing(tuple(notes), title), patch_table(document)),
    )


def _caveats(document: Document) -> Iterator[str]:
    for remark in document.get("remarks", ()):
        yield str(Remark.from_json_dict(remark))
    yield from document["cautions"]


def _provenance(document: Document) -> Section:
    provenance = document.get("provenance") or {}
    versions = (
        *provenance.get("versions", {}).items(),
        ("schema of the document", str(document["schema_version"])),
    )
    hashes = tuple(provenance.get("sha256", {}).items())
    seconds = tuple((name, f"{value:.1f} s") for name, value in document["seconds"].items())
    alarms = significant(document["gap"]["false_alarm_rate"], 2)
    tests = tests_table(document)
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
            Paragraph(noise_line(document)),
            Paragraph(model_line(document)),
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
