"""Findings of a diagnosis, as frozen values with units: the source of its document and its words."""
