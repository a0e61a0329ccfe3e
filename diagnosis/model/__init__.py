"""The runs as the fits see them, and one nominal model for each kind of rig."""
