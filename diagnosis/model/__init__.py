"""The nominal models, one type for each kind of rig, and the parameters that fits have."""
