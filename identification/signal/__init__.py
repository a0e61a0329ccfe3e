"""One free-decay record: its motion, its noise, and what can be fitted to it."""
