"""The runs as fits see them, and the nominal models: one type for each kind of rig, chosen once."""
