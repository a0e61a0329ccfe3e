"""The examination of a campaign before any estimate, the same for every command."""
