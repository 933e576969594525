"""The withheld check: logs of a bench of its own code path, keys apart, and what a diagnosis made of them."""
