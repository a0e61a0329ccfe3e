"""Predictions of an answer: held-out readings, and its coefficients by linear theory."""
