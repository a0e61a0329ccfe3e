"""Findings of a diagnosis, each with its numbers, words, tables and figure."""
