"""Numbers of a MuJoCo actuator by name: the gains of a servo, and the limit of its force."""

from __future__ import annotations

from typing import Any

import numpy as np

FED_BACK = {"actuator_kp": 1, "actuator_kv": 2}
"""Place of a servo's gains among the parameters of its bias."""
FORCE = "actuator_forcerange"
"""The largest force of an actuator, in the unit of its own transmission; 0, as in MJCF, where it has no limit."""
SERVO = (*FED_BACK, FORCE)
"""Numbers that only servos have: the force of another actuator is limited where its command is."""


class Gain:
    """A servo's gain as an array has it: it acts on what is fed back and, where the command has it too, on that."""

    def __init__(self, m: Any, k: int) -> None:
        self._m, self._k = m, k

    def __getitem__(self, place: int) -> float:
        return -float(self._m.actuator_biasprm[self._k, place])

    def __setitem__(self, place: int, value: float) -> None:
        gain, bias = self._m.actuator_gainprm[self._k], self._m.actuator_biasprm[self._k]
        if gain[0] == -bias[place]:
            gain[0] = value
        bias[place] = -value


class ForceRange:
    """The limit of an actuator's force as an array has it: the larger end of its range, whose shape it keeps."""

    def __init__(self, m: Any, k: int) -> None:
        self._m, self._k = m, k
        own = np.array(m.actuator_forcerange[k]) if m.actuator_forcelimited[k] else np.zeros(2)
        self._value = float(np.max(np.abs(own)))
        self._ends = own / self._value if self._value > 0.0 else np.array([-1.0, 1.0])

    def __getitem__(self, place: int) -> float:
        return self._value

    def __setitem__(self, place: int, value: float) -> None:
        self._value = float(value)
        self._m.actuator_forcelimited[self._k] = value > 0.0
        self._m.actuator_forcerange[self._k] = self._value * self._ends


def put_gain(actuator: Any, place: int, value: float) -> None:
    """Write a servo's gain into the actuator of a model as it is written."""
    gain, bias = np.array(actuator.gainprm, dtype=float), np.array(actuator.biasprm, dtype=float)
    if gain[0] == -bias[place]:
        gain[0] = value
    bias[place] = -value
    actuator.gainprm, actuator.biasprm = gain, bias


def put_force_range(actuator: Any, m: Any, k: int) -> None:
    """Write the limit of the force that an actuator of a compiled model has into the one of the model as written."""
    if m.actuator_forcelimited[k]:
        actuator.forcelimited, actuator.forcerange = 1, np.array(m.actuator_forcerange[k])
