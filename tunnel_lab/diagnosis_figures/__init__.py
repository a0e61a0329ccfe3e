"""Figures of a diagnosis, drawn from its JSON document. matplotlib is imported inside the functions.

They compute nothing; their data are those of the document.
"""
