"""The rig's MJCF model and the source of the engine plugin: data only."""
