"""Experiments of many simulated campaigns: sweeps, scores, and the training of `neural_posterior`.

`runner` does the unfinished tasks, in processes or on a cluster. Each experiment states its cases, work and files:
`sweep*`, `score_*` and `breakdown`, `training*`.
"""
