"""One free-decay record: its motion, noise, frequency, filter and windows, and what can be fitted to it."""
