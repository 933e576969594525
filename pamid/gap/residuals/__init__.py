"""Residual sources: a log compared with a simulator, as one vector of windows."""
