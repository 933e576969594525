"""A driven joint with a lever: its drive against inertia and gravity."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..effects.spec import EffectLike
from ..errors import ExcitationError, MissingColumnError, MissingParameterError
from ..signals.resting import at_rest, resting_rows
from ..signals.savgol import rate_over
from ..simulators.problem import Problem
from .base import FIT, Choice, Input, Quantity, System

_FULL = 0.95  # of the limit: beyond it a controller's demand is unknown
_TELLING = 0.02  # of a lever's moment: a smaller change of cos q cannot be told from an offset (settings.py --computed)
_LEAST = 50  # least rows of motion with a known drive
_UNEVEN = 0.02  # of a step: times that vary by more are brought to equal steps before rates are taken
_STILL = 0.05  # rad/s: speed at which the smoothed sign of the motion is three quarters


class Joint(System):
    r"""Servo, motor or actuator that turns a lever.

    .. math:: \tau = J\,\ddot q + m g l\,\sin q + a\,\cos q + c

    :math:`\tau` is what drives it, in any unit: a logged torque, current or voltage (``drive``), or what a
    proportional controller makes of its error, ``gain`` (q_ref - q), up to ``limit``, times the supply ``voltage`` if
    that is logged. With ``"fit"`` the inertia and the moment of gravity are fitted to the log together with friction,
    which is then left out of the nominal model.
    """

    kind = "joint"
    title = "a driven joint (servo, motor): what drives it against inertia and gravity"
    law = "drive = inertia · d²q/dt² + gravity · sin q + level · cos q + offset"
    targets = ("drive",)
    signals = (
        Input("q", "rad", "angle"),
        Input("drive", "any", "torque, current or voltage that drives it", needed=False),
        Input("q_ref", "rad", "reference angle, where a proportional controller drives it", needed=False),
        Input("gain", "1/rad", "gain of that controller, where it changes between runs", needed=False),
        Input("voltage", "V", "supply voltage, where the controller sets a duty", needed=False),
        Input("enabled", "-", "1 while the drive is on", needed=False),
    )
    one_of = (("drive", "q_ref"),)
    quantities = (
        Quantity("gain", "1/rad", 0.0, 1e9, "drive for 1 rad of control error; 0: the log has drive, or gain", 0.0),
        Quantity("limit", "-", 0.0, 1e9, "largest drive the controller can set, before the voltage; 0: none", 1.0),
        Quantity("inertia", "drive s^2/rad", 0.0, 1e9, "drive for 1 rad/s²", FIT, may_fit=True),
        Quantity("gravity", "drive", -1e9, 1e9, "drive that holds the lever level (m g l)", FIT, may_fit=True),
        Quantity("level", "drive", -1e9, 1e9, "drive by cos q", FIT, may_fit=True),
        Quantity("offset", "drive", -1e9, 1e9, "drive at rest", FIT, may_fit=True),
        Quantity("smoothing", "s", 1e-3, 10.0, "window over which rates of the angle are taken", 0.1),
    )
    choices = (Choice("unit", ("unknown", "N m", "V", "A"), "unit of the logged drive", "unknown"),)
    settings = ("smoothing",)
    sense = -1
    library = "motor"
    estimator = "JointDrive"

    @classmethod
    def own(cls, signals: Collection[str]) -> list[str]:
        """Return ``gain`` where the log has neither the drive nor the controller's gain."""
        return [] if {"drive", "gain"} & set(signals) else ["gain"]

    def identity(self) -> dict[str, Any]:
        """Return the identity of the joint; numbers that earlier versions always fitted only where they are given."""
        found = super().identity()
        numbers = {k: v for k, v in found["numbers"].items() if v != FIT or k not in ("level", "offset")}
        return {**found, "numbers": numbers}

    @property
    def units(self) -> dict[str, str]:
        """The drive's unit, radian; in place of a pressure there is a load in the drive's unit."""
        unit = "drive unit" if self.values["unit"] == "unknown" else str(self.values["unit"])
        return {"target": unit, "position": "rad", "pressure": unit}

    def samples(self, log: pd.DataFrame) -> pd.DataFrame:
        """Return a log with the drive of each row, none where it is off or at its limit."""
        self.require(log)
        drive, usable, *_ = self._drive(log)
        return log.assign(drive=np.where(usable, drive, np.nan))

    def unit_of(self, columns: Collection[str]) -> str:
        """Return the unit of the joint's drive on a log with some columns."""
        if "drive" in columns:
            return "drive unit" if self.values["unit"] == "unknown" else str(self.values["unit"])
        return "V" if "voltage" in columns else "output unit"

    def corrected(self, effects: Sequence[EffectLike], sense: int, unit: str) -> System:
        """Return the joint with further effects, and the unit of its drive where the log has told it."""
        found = super().corrected(effects, sense, unit)
        return found.with_({"unit": unit}) if unit in self.choices[0].options else found

    def nominal_problem(self, log: pd.DataFrame) -> Problem:
        """Return the equation of the drive on a log; see `System.nominal_problem`."""
        self.require(log)
        drive, usable, unit, notes = self._drive(log)
        q = log["q"].to_numpy(dtype=float)
        dq, ddq = self._rate(log, 1), self._rate(log, 2, 1.5)
        usable &= np.isfinite(drive) & np.isfinite(q) & np.isfinite(ddq)
        if usable.sum() < _LEAST:
            raise ExcitationError(
                f"{int(usable.sum())} rows have a known drive.",
                f"at least {_LEAST}",
                "Check gain, limit and enabled.",
            )
        if (left := int((~usable).sum())) > 0:
            notes.append(f"{100 * left / len(log):.1f} % of the rows are left out: the drive is off or at its limit.")
        resting = self._resting(log) & usable
        if resting.any() and (usable & ~resting).sum() >= _LEAST:
            usable &= ~resting
            notes.append(at_rest("q", float(resting.mean())))
        nominal, said, numbers = self._nominal(q, dq, ddq, drive, usable)
        load = np.abs(nominal - np.mean(nominal[usable]))
        X = pd.DataFrame({"time": log["time"].to_numpy(dtype=float), "q": q, "dq": dq, "load": load})[usable]
        X["nominal"] = X["transmitted"] = nominal[usable]
        groups = log["trajectory"].to_numpy()[usable]
        roles = {"time": "time", "position": "q", "velocity": "dq", "pressure": "load", "force": "transmitted"}
        notes += [
            said,
            "The 'pressure' of load-dependent friction is the load by inertia and gravity, in the drive's unit.",
        ]
        units = {"target": unit, "position": "rad", "pressure": unit}
        fitted = self.with_(numbers)
        return Problem(X, drive[usable], _given, groups, roles, "torque", unit, None, notes, units, None, fitted)

    def _drive(self, log: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, str, list[str]]:
        """Return the drive of the joint, the rows in which it is known, its unit, and notes."""
        on = np.ones(len(log), dtype=bool)
        if "enabled" in log.columns:
            on = log["enabled"].to_numpy(dtype=float) > 0.5
        if "drive" in log.columns:
            return log["drive"].to_numpy(dtype=float), on, self.unit_of(log.columns), []
        if "q_ref" not in log.columns:
            raise MissingColumnError(
                f"The log has neither drive nor q_ref; it has {', '.join(map(str, log.columns[:20]))}.",
                "what drives the joint, or the reference angle of its controller",
                "Map one of them.",
            )
        logged = log["gain"].to_numpy(dtype=float) if "gain" in log.columns else None
        gain = self.number("gain") if logged is None else logged
        if not np.any(gain):
            raise MissingParameterError(
                "[joint] has no gain, and neither the log nor the mapping has drive or gain.",
                "the drive for 1 rad of control error, from the manual of the servo",
                'Set gain in the file (duty of a servo: kp · steps per turn / 2π / full scale), or map "gain".',
            )
        error = (log["q_ref"] - log["q"]).to_numpy(dtype=float)
        wanted, limit = gain * error, float(self._given["limit"])
        if limit:  # what a fit makes of gain and limit changes no rows
            on &= np.abs(error * (float(self._given["gain"]) if logged is None else logged)) < _FULL * limit
        if "voltage" in log.columns:
            wanted = wanted * log["voltage"].to_numpy(dtype=float)
        return wanted, on, self.unit_of(log.columns), []

    def _rate(self, log: pd.DataFrame, order: int, longer: float = 1.0) -> np.ndarray:
        """Return a rate of the angle at each row; NaN where a gap takes more than half of its window."""
        parts = []
        for _, run in log.groupby("trajectory", sort=False):
            time, q = run["time"].to_numpy(dtype=float), run["q"].to_numpy(dtype=float)
            dt = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
            half = max(2, round(0.5 * longer * self.number("smoothing") / dt))
            if len(time) < 2 or np.ptp(np.diff(time)) <= _UNEVEN * dt:
                parts.append(rate_over(q, dt, half, order))
                continue
            even = np.arange(time[0], time[-1] + dt, dt)
            rate = np.interp(time, even, rate_over(np.interp(even, time, q), dt, half, order))
            for k in np.flatnonzero(np.diff(time) > half * dt):
                rate[(time > time[k] - half * dt) & (time < time[k + 1] + half * dt)] = np.nan
            parts.append(rate)
        return np.concatenate(parts)

    @staticmethod
    def _resting(log: pd.DataFrame) -> np.ndarray:
        """Return the rows in which the joint rests."""
        steps = np.diff(log["time"].to_numpy(dtype=float))
        dt = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 1.0
        return resting_rows(
            log["q"].to_numpy(dtype=float), dt, log.groupby("trajectory", sort=False).ngroup().to_numpy()
        )

    def _nominal(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, drive: np.ndarray, usable: np.ndarray
    ) -> tuple[np.ndarray, str, dict[str, float]]:
        """Return inertia and gravity on every row, a sentence on them, and the joint with their fitted numbers."""
        columns = {"level": np.cos(q), "inertia": ddq, "gravity": np.sin(q), "offset": np.ones(len(q))}
        given = {name: self.number(name) for name in columns if self.values[name] != FIT}
        known = sum((value * columns[name] for name, value in given.items()), np.zeros(len(q)))
        fitted = {name: x for name, x in columns.items() if name not in given}
        if "level" in fitted:
            others = np.column_stack([x for name, x in fitted.items() if name != "level"] or [np.zeros(len(q))])[usable]
            level = columns["level"][usable]
            if np.std(level - others @ np.linalg.lstsq(others, level, rcond=None)[0]) <= _TELLING:
                fitted.pop("level")
        A = np.column_stack([*fitted.values(), np.tanh(dq / _STILL), dq])
        found, *_ = np.linalg.lstsq(A[usable], (drive - known)[usable], rcond=None)
        n = len(fitted)
        nominal = known + A[:, :n] @ found[:n]
        values = {**given, **dict(zip(fitted, map(float, found[:n]), strict=True))}
        said = ", ".join(f"{name} {value:.3g}{'' if name in given else ' (fitted)'}" for name, value in values.items())
        left = (drive - known)[usable] - A[usable] @ found
        share = 1.0 - float(np.var(left) / max(np.var(drive[usable]), 1e-300))
        plausible = {q.name: (q.lower, q.upper) for q in self.quantities}
        kept = {k: v for k, v in {"level": 0.0, **values}.items() if plausible[k][0] <= v <= plausible[k][1]}
        return nominal, f"Nominal model: {said}; with dry and viscous friction beside it, R² = {share:.3f}.", kept


def _given(X: pd.DataFrame) -> np.ndarray:
    return X["nominal"].to_numpy(dtype=float)
