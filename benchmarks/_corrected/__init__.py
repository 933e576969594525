"""Parts of `benchmarks/corrected_runs.py`: further systems, their pages, and the logs of bench, cylinder and joint."""
