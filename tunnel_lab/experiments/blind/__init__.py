"""Blind tests: campaigns with their truth in a sealed key, hashed answers, and the score.

`make_blind` draws campaigns with the reference simulator (another integrator and other forms of the effects
than in the fits), `answer_set` diagnoses them without the key, `score_set` checks all hashes, opens the key and
counts.
"""

from tunnel_lab.experiments.blind.answers import answer_set, answers_folder
from tunnel_lab.experiments.blind.set_score import BlindScore, score_set
from tunnel_lab.experiments.blind.sets import make_blind
from tunnel_reference.draw import DEFAULT_SHARES, Mixture
from tunnel_reference.make import parse_shares

__all__ = [
    "DEFAULT_SHARES",
    "BlindScore",
    "Mixture",
    "answer_set",
    "answers_folder",
    "make_blind",
    "parse_shares",
    "score_set",
]
