"""The next runs: those of a continuous family that best decide between the explanations of a diagnosis."""
