"""The fuzzer behind ``make fuzz``: damaged files for every reader, odd values for the API."""

import os

# Before NumPy is loaded, here and in the workers: threads that spin would share the machine.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
