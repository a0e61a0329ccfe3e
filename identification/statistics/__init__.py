"""Linear algebra and statistics that every estimator shares."""
