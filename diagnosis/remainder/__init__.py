"""The explainable part of an answer's residual, and the law for it."""
