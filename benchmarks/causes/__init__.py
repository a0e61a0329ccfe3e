"""A benchmark of naming the causes of a sim-to-real gap: a frozen set, entries, scores and a table.

``python -m benchmarks.causes make FOLDER`` makes the set, ``run METHOD FOLDER`` answers it with one of the
methods here, ``score FOLDER ANSWERS`` scores any entry, ``page`` draws the table. README.md beside this file
says how to enter.
"""
