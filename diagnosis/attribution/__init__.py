"""Which effects cause the gap: ranked, fitted, weighed."""
