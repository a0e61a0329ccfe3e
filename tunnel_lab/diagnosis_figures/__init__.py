"""Figures of a diagnosis, drawn from its JSON document. matplotlib is imported inside the functions.

They compute nothing: what they show was found by the diagnosis and stands in the document.
"""
