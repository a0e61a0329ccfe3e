"""The values everything speaks in: records, campaigns, plans, the rig, the air, and the one error."""
