"""The rig's MJCF model and its engine plugin's source: data, no Python."""
