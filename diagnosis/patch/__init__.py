"""The causes written into a model of one's own."""
