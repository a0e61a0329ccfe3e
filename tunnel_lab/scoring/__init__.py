"""Estimators against records of known truth: over a grid, against a baseline, under unmodelled effects."""
