"""One free-decay record: its motion, noise, frequency, filter and windows, and the models fitted to it."""
