"""Everyday slips: statements against records, before any fit. `table` lists them."""
