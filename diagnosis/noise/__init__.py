"""The noise of the records, and whether there is a gap beyond it."""
