"""One thread of linear algebra in each process: the suite runs a process on every core."""

from __future__ import annotations

import os

from hypothesis import settings

# Set before NumPy loads, and handed on to the workers and to every command that a test starts.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A loaded machine may take a second over one example.
settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")
