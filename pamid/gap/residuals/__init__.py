"""Residual sources: a log held against a simulator, as one vector of windows."""
