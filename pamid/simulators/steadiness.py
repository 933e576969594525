"""Whether a user's simulator is repeatable."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ForeignSimulatorError, PamidError, SimulatorWarning
from .base import Simulator

if TYPE_CHECKING:
    from .port_log import PortLog

_INSTANTS = 24
_SAME = 1e-6
"""Relative difference that warm-started solvers may show."""


def tell_if_unsteady(simulator: Simulator, log: PortLog) -> str:
    """Warn, once, where a simulator is random or keeps state between calls; return what was said."""
    if simulator.unsteady is None:
        simulator.unsteady = unsteadiness(simulator, log)
        if simulator.unsteady:
            warnings.warn(simulator.unsteady, SimulatorWarning, stacklevel=2)
    return simulator.unsteady


@np.errstate(invalid="ignore")  # infinite values are told where they are evaluated
def unsteadiness(simulator: Simulator, log: PortLog) -> str:
    """Return that a simulator is random or keeps state between calls, and how much; empty where it does not."""
    if not simulator.executes:
        return ""
    try:
        first, again = _asked(simulator, log)
    except ForeignSimulatorError:
        raise  # it has hung or died: whoever asks again waits again
    except PamidError:
        return ""  # reported where it is actually evaluated
    size = np.max(np.abs(first), axis=-1, keepdims=True, initial=0.0)
    apart = np.abs(again - first) > _SAME * size + 1e-300
    if not apart.any():
        return ""
    rows, worst = apart.any(axis=-1), float(np.nanmax(np.abs(again - first) / np.maximum(size, 1e-300)))
    names = simulator.states if simulator.form == "ode" else simulator.outputs
    where = ", ".join(n for n, wrong in zip(names, rows, strict=False) if wrong) or "its answer"
    return (
        f"Called twice with the same inputs, the simulator returns different values of {where} (by up to {worst:.2g} "
        "of the largest value): it is random, or keeps state between calls. Fits and intervals need repeatable values: "
        "fix its seed in each call, and keep no state from one call to the next."
    )


def _asked(simulator: Simulator, log: PortLog) -> tuple[np.ndarray, np.ndarray]:
    """Return two evaluations at the same point, with another one in between."""
    a, b = log.spans[0]
    at = np.arange(a, b)  # a whole run: a cut one may differ
    if simulator.form != "run":
        at = np.unique(np.linspace(a, b - 1, _INSTANTS).astype(int))
    starts = {p.name: p.begins for p in simulator.ports}
    x, u = (
        np.array([log.channels.get(n, np.full(log.n, starts.get(n, 0.0)))[at] for n in names]).reshape(-1, len(at))
        for names in (simulator.states, simulator.inputs)
    )
    t = log.t[at] - log.t[at[0]] if simulator.form == "run" else log.t[at]
    if simulator.form == "run":
        first = simulator.run(t, u, simulator.numbers, x[:, 0])
        simulator.run(t, 0.5 * u, simulator.numbers, x[:, 0])
        return first, simulator.run(t, u, simulator.numbers, x[:, 0])
    ask = simulator.rate if simulator.form == "ode" else simulator.output
    p = np.repeat(np.asarray(simulator.numbers, dtype=float)[:, None], len(at), axis=1)
    first = ask(t, x, u, p)
    return first, ask(t[::-1], x[:, ::-1], u[:, ::-1], p)[:, ::-1]
