"""The format of names and numbers: effects, channels, probabilities, shares, and gaps in customary units."""

from __future__ import annotations

"""A diagnosis in JSON's types (`Diagnosis.to_json_dict`)."""
