"""From a study to the answer: held-out closure, coefficients, rivals, words."""
