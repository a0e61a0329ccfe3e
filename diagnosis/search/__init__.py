"""Which effects cause the gap: sets of them are grown, fitted and weighed."""
