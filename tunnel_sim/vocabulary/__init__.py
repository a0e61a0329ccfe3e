"""The types that all packages share: record, campaign, plan, rig, aerodynamic derivatives, error and limits."""
