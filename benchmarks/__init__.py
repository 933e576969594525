"""Measurements behind the figures of the docs; each file is run by itself."""
