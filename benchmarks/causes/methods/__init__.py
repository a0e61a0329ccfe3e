"""Methods that name causes, one program each; each has `ABOUT` and `answer`."""

METHODS = (
    "ours",
    "forward_bic",
    "discrepancy_evidence",
    "neural_classifier",
    "mujoco_sysid",
    "pysindy_ensemble",
    "spike_and_slab",
    "lisdd",
    "nearest_template",
    "always_unknown",
)
"""In the order of the table where scores are equal."""
