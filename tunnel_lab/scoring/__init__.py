"""Scores of estimators on records of known truth: over a grid, against a baseline, and under unmodelled effects."""
