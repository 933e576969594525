"""Fitting: bounded least squares, Levenberg–Marquardt, small networks, free runs and memories of streams.

Pure numerics on arrays; estimators hold parameters, validation and fitted attributes, and call these.
"""
