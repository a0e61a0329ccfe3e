"""Studies behind the tutorials and pages of this documentation; run from the root of a checkout."""
