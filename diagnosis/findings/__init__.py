"""Findings: what a diagnosis states, each with its numbers, words, tables and figure."""
