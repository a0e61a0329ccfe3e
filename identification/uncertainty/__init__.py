"""The uncertainty of an estimate: bounds, scatter, budgets."""
