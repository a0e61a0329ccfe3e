"""The diagnosis of the sim-to-real gap: where the nominal model departs, why, and how far it closes."""
