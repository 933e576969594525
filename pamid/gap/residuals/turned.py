r"""Decoupled equations of motion: residuals of rates converted to those of forces.

A force that is missing at one joint shows in the accelerations of all that are coupled to it. Where the inertia M is
known, :math:`M(\ddot q - f)` are the forces that the motion needs, one per joint. Where only the sensitivities G of the
rates to the inputs are (:math:`\partial f/\partial u`, those of driven joints first), residuals are transformed so that
an error of an input shows only in the equation of its joint,

.. math:: r_1' = \operatorname{diag}(G_1)\, G_1^{-1} r_1, \qquad r_2' = r_2 - G_2 G_1^{-1} r_1

which frees the equation of a pendulum on a driven arm, for example, of errors of the arm's motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...simulators.base import Simulator
from ...simulators.structure import JointPort, spread_numbers

_SINGULAR = 1e6
"""Condition number, inputs in their ranges, beyond which drives cannot be distinguished."""


class Turned(NamedTuple):
    """A linear map of the residuals of some equations, window by window."""

    equations: list[int]
    """Places of the equations."""
    by: np.ndarray
    """The map, shape (n_windows, n_equations, n_equations)."""
    forces: bool
    """Whether the result is forces rather than rates."""

    def __call__(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return the residuals of all equations, some of them transformed."""
        out = list(parts)
        turned = np.einsum("nij,jn->in", self.by, np.stack([parts[k] for k in self.equations]))
        for k, row in zip(self.equations, turned, strict=True):
            out[k] = row
        return out


def turned(
    simulator: Simulator, equations: Sequence[tuple[int, int, str]], joints: Sequence[JointPort], t: np.ndarray,
    x: np.ndarray, u: np.ndarray, step: np.ndarray,
) -> Turned | None:  # fmt: skip
    """Return the map of residuals of rates, to forces where the inertia is known, else by drives; None if not coupled.

    It is that of some instants; a `step` is a change of each input that counts as small.
    """
    inertia = simulator.inertia(x) if equations else None
    if inertia is not None:
        return Turned([k for k, _, _ in equations], inertia, True)
    through = {j.name: j.through for j in joints if j.through in simulator.inputs}
    driven = [k for k, (_, _, name) in enumerate(equations) if name in through]
    if simulator.form != "ode" or not driven or len(equations) < 2:
        return None
    rows, p = [row for _, row, _ in equations], spread_numbers(simulator, len(t))
    base = simulator.rate(t, x, u, p)[rows]
    G = np.zeros((len(t), len(equations), len(driven)))
    for column, k in enumerate(driven):
        i, moved = simulator.inputs.index(through[equations[k][2]]), u.copy()
        moved[i] += step[i]
        G[:, :, column] = (simulator.rate(t, x, moved, p)[rows] - base).T
    if not np.all(np.isfinite(G)) or np.max(np.linalg.cond(G[:, driven])) > _SINGULAR:
        return None
    inverse = np.linalg.inv(G[:, driven])
    turned = np.repeat(np.eye(len(equations))[None], len(t), axis=0)
    turned[:, :, driven] -= G @ inverse
    turned[:, driven, :] = 0.0
    own = np.einsum("nkk->nk", G[:, driven])[:, :, None] * inverse
    for k, column in enumerate(driven):
        turned[:, driven, column] = own[:, :, k]
    return Turned([k for k, _, _ in equations], turned, False)
