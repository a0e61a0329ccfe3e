"""The residual that no named effect explains: the share that could be explained, and the law for it."""
