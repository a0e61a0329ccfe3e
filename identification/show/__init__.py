"""The ground of everything that presents: blocks, drawing and its style."""
