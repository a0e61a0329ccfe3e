"""The documentation; only `docs.studies` holds code."""
