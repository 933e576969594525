"""What drives a joint: inertia, gravity and friction."""

from typing import Any, NamedTuple

import numpy as np

from ._linear import BalanceRegressor
from ._parameters import parameters


class _JointSignals(NamedTuple):
    q: Any
    dq: Any
    ddq: Any


@parameters
class JointDrive(BalanceRegressor):
    r"""Torque, current or voltage that drives a joint with a lever, fitted by linear least squares.

    .. math:: \tau = J\,\ddot q + g\,\sin q + a\,\cos q + b + f\,\tanh\frac{\dot q}{\omega_0} + d\,\dot q

    All parameters are in the unit of the drive. Signals: ``q``, ``dq``, ``ddq``.

    Parameters
    ----------
    unit : str, default="drive"
        Unit of the drive, such as ``"N m"`` or ``"V"``.
    still : float, default=0.05
        Speed ω₀, rad/s, at which dry friction has reached three quarters.

    Attributes
    ----------
    coef_ : ndarray, shape (6,)
        The parameters, in the unit of the drive.
    parameters_ : dict of str to float
        ``inertia`` J (drive for 1 rad/s²), ``gravity`` g (drive that holds the lever level), ``level`` a and
        ``offset`` b (drive), ``dry_friction`` f (drive), ``viscous_friction`` d (drive for 1 rad/s).

    See Also
    --------
    CylinderForce : The same for a pneumatic cylinder.

    References
    ----------
    M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots", IEEE
    Transactions on Robotics and Automation 6(3), 1990. https://doi.org/10.1109/70.56655

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import JointDrive
    >>> rng = np.random.default_rng(0)
    >>> q, dq, ddq = rng.normal(0, 1, (3, 500))
    >>> fit = JointDrive("N m").fit(np.c_[q, dq, ddq], 0.1 * ddq + 0.5 * np.sin(q) + 0.2 * np.tanh(dq / 0.05))
    >>> round(fit.parameters_["gravity"], 6), fit.units_["inertia"]
    (0.5, 'N m s²/rad')
    """

    unit: str = "drive"
    still: float = 0.05

    reads = ("q", "dq", "ddq")
    equations = ("drive",)
    _state = _JointSignals
    _checked = ({},)

    def _output(self) -> tuple[str, str]:
        return "drive", self.unit

    def _terms(self) -> dict[str, str]:
        u = self.unit
        return {
            "inertia": f"{u} s²/rad", "gravity": u, "level": u, "offset": u, "dry_friction": u,
            "viscous_friction": f"{u} s/rad",
        }  # fmt: skip

    def _shares(self, state: _JointSignals) -> list[Any]:
        level = np.sin(state.q + 0.5 * np.pi)  # cos q: ONNX runtimes know the sine alone in double precision
        one = 1.0 + 0.0 * state.q
        return [state.ddq, np.sin(state.q), level, one, self._way(state.dq), state.dq]
