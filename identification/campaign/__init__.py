"""Many records together: pairs, springs, derivatives."""
