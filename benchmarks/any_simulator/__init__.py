"""Withheld cases on simulators of four kinds: systems, causes and their keys in code of their own."""
