"""The answers of a document. Truth: what a study answers with."""

from __future__ import annotations

from dataclasses import replace

from diagnosis.answer.held_out import excess_base
from diagnosis.findings.candidates import Candidate, candidates
from diagnosis.findings.causes import NamedCauses
from diagnosis.search.scatter import scattered as beside_scatter
from identification.estimate import Quantity
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import answer, campaign, nominal, studied
from tests.support.scattered_runs import SCATTERED, scattered
from tunnel_sim.effects import effect_class, effect_from


def test_scatter_alone_has_a_name_beside_an_answer_of_runs_that_repeat():
    data = campaign(effect_from("gravity_stiffness", {"stiffness": 0.5}))
    base = nominal(data)
    study = studied(data, base, ("gravity_stiffness",))
    both = (answer(("gravity_stiffness",), 0.0, 0.9), answer((), 0.0, 0.1))
    found = candidates(replace(study, answers=both), excess_base(study), {})
    scatter = "damping_scatter + stiffness_scatter + wind_speed_scatter"
    assert [one.effect for one in found] == ["gravity_stiffness", scatter, "none"]


def test_a_rival_has_the_names_of_its_own_scatter():
    data = scattered()
    base = nominal(data)
    layered = beside_scatter(base, [effect_class(name) for name in SCATTERED])
    assert layered is not None
    study = studied(data, base, ("gravity_stiffness",), base)
    rival = answer(("coulomb_friction",), 0.0, 0.1, layered)
    repeating = answer(("quadratic_damping",), 0.0, 0.1, base)
    found = candidates(replace(study, answers=(*study.answers, rival, repeating)), excess_base(study), {})
    first, *others = (set(one.effect.split(" + ")) for one in found)
    assert first == {"gravity_stiffness"}
    assert {"quadratic_damping"} in others
    (whole,) = [names for names in others if "coulomb_friction" in names]
    assert len(whole) > 1
    assert whole <= {"coulomb_friction", *SCATTERED}


def test_scatter_of_a_rival_alone_is_part_of_the_alternative():
    answers = (
        Candidate("spring_miscalibration", 0.6, 0.0, 1.0),
        Candidate("gravity_stiffness + stiffness_scatter", 0.35, 0.0, 1.0),
    )
    named = NamedCauses(("spring_miscalibration",), ("gravity_stiffness",), answers, {}, (), False, 0.1)
    assert named.certain_and_open() == (
        [],
        [("spring miscalibration", 0.6), ("gravity stiffness and scatter between runs", 0.35)],
    )


def test_effects_say_their_sizes_as_a_person_would():
    def size(effect, parameter, given, asked=""):
        one = Candidate(effect, 0.9, 0.0, 0.0, {parameter: given})
        return findings_of(document()).named_causes.said_size(one, asked or effect)

    friction = Quantity(0.0039991, 4.1e-6, "N m")
    assert size("coulomb_friction", "friction_moment", friction) == "dry friction of 0.00400 N m"
    play = Quantity(0.0123, 0.0012, "rad")
    assert (
        size("free_play", "half_width", play) == "play of 0.705 ± 0.069° to each side between spring and rod"
    )
    assert size("free_play", "half_width", play, "cubic_stiffness") == ""
