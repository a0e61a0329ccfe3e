"""Experiments of many simulated campaigns: sweeps, scores, and the training of `neural_posterior`.

`runner` does the tasks that are not finished, in processes or on a cluster. Each experiment states its cases, its
work and its files: `sweep*`, `score_*` and `breakdown`, `training*`.
"""
