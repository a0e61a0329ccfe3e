"""Experiments of many simulated campaigns: sweeps, scores, and the training of `neural_posterior`.

`experiment` does the unfinished tasks and stores their results, on the workers of `runner`. Each kind states
its tasks and its work: `sweep*`, `score*`, `breakdown`, `training*` and `blind`.
"""
