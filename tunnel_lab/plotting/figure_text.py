"""Texts of the user's in matplotlib's figures."""

from __future__ import annotations


def figure_text(text: str) -> str:
    """A text of the user's, such as the id of a run, as matplotlib has to be given it to show it as it is.

    Dollar signs would begin a formula, and a legend leaves out what begins with an underscore.

    Returns:
        The text with its dollar signs escaped, and with a blank before a leading underscore.
    """
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")
