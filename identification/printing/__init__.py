"""How results are printed: numbers with their standard deviations, plain tables, and Polars frames."""
