"""Which periods of an effect of the position a log supports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...effects import Parameter

if TYPE_CHECKING:
    from ..residuals.protocol import ResidualSource
    from .sensitivity import Template

PEAKS = 4
"""Periods that compete: a search among sets costs a power of their number, and a sine is not explained by others."""


def peaks(evidence: ResidualSource, found: list[Template], finely: Sequence[Parameter]) -> list[Template]:
    """Return templates on a fine grid that close more than their neighbours, the best of them; others as they are."""
    if not finely or len(found) <= PEAKS:
        return found
    Q = np.linalg.qr(evidence.J)[0] if evidence.J.shape[1] else np.zeros((len(evidence.z0), 0))
    left = evidence.z0 - Q @ (Q.T @ evidence.z0)
    gains = np.empty(len(found))
    for k, t in enumerate(found):
        columns = t.columns - Q @ (Q.T @ t.columns)
        gains[k] = float(np.sum((np.linalg.qr(columns)[0].T @ left) ** 2))
    around = np.pad(gains, 1, constant_values=-np.inf)
    highest = np.flatnonzero((gains >= around[:-2]) & (gains >= around[2:]))
    return [found[k] for k in sorted(highest[np.argsort(-gains[highest])][:PEAKS])]
