"""The next runs: which of a continuous family best discriminate what a diagnosis left undecided."""
