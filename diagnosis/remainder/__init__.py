"""What no named effect explains: how much of it could be closed, and the law that would close it."""
