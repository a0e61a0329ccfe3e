"""Everyday slips: what is stated against what is recorded, before any fit. `table` lists them."""
