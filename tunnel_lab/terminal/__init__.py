"""Output of the commands: tables, numbers, progress."""
