"""The causes written into the user's own model."""
