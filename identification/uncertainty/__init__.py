"""What an estimate is worth: information, bounds, budgets."""
