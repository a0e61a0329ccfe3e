"""The ground layer of all presentation: blocks, drawing and its style."""
