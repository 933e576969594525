"""The withheld check: which of the causes hidden from the diagnosis are named, and how much of the gap they close."""
