"""The physics of one run: moment law, settings, integration steps and motion."""
