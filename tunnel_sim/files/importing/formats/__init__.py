"""Step 1 of an import: readers of formats, which turn the content of a file into tables."""
