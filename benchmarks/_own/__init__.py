"""Parts of `benchmarks/own_simulators.py`: systems, logs of them, and a suite a file."""
