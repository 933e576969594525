"""The diagnosis on a stream: which effect has appeared since the monitor was calibrated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np

from ..effects.plant import Plant
from ..effects.spec import effect_of
from ..errors import EmptyLogError, MissingColumnError, ParameterError
from ..explained import explained_fields
from ..laws.base import Law
from ..signals.state import STATE_SIGNALS, State
from ..volume.base import VolumeModel
from .alarm import DriftAlarm, threshold
from .memory import StreamedEffect
from .sight import StillSensors

HYPOTHESES = ("leakage", "coulomb_friction", "viscous_friction", "hysteresis", "bladder_elasticity")
"""Effects that may appear, by default."""

BLOCKS = 50
"""Least number of blocks of a healthy stretch."""

WILD = 30.0
"""Times the noise beyond which a sample is wild."""


@explained_fields
@dataclass(frozen=True)
class Finding:
    """What a monitor has found.

    Examples
    --------
    >>> from pamid.online import Finding
    >>> found = Finding("leakage", "flow", time=22.4, strength=1.3, value=5e-11, unit="m^3/(s Pa)")
    >>> f"{found.effect} after {found.time} s: {found.value:g} {found.unit}"
    'leakage after 22.4 s: 5e-11 m^3/(s Pa)'
    """

    effect: Annotated[
        str, 'The effect that explains the change best, or ``"unknown"`` where the residual grew and none does.'
    ]
    equation: Annotated[str, "The equation in which it appeared."]
    time: Annotated[float, "When the alarm was raised, s."]
    strength: Annotated[float, "Evidence over its threshold, above one."]
    value: Annotated[float, "Estimate of the effect's parameter, in its own unit; NaN if unknown."]
    unit: Annotated[str, "Its unit."]


class _Watch:
    """One equation of one muscle with the effects that may appear in it."""

    def __init__(self, law: Law, effects: list[StreamedEffect], settings: Mapping[str, float]) -> None:
        self.law = law
        self.effects = effects
        self.names = [(e.effect.name, n, u) for e in effects for n, u in zip(e.names, e.units, strict=True)]
        lower = np.concatenate([np.zeros(0), *(e.lower for e in effects)])
        self.start = np.zeros(len(self.names))
        groups = [k for k, e in enumerate(effects) for _ in e.names]
        self.alarm = DriftAlarm(lower >= 0.0, settings["memory"], int(settings["hold"]), settings["limit"], groups)
        self.offset = 0.0
        self.factor = 1.0
        self.noise = 1.0
        self.power_scale = 1.0
        self.restart()

    def residual(self, volume: VolumeModel, state: State, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        modelled = np.asarray(self.law.predict(*volume.jet(state), state))
        H = [e.linearised(state, np.zeros(len(e.names)))[1] for e in self.effects]
        return measured - self.factor * modelled - self.offset, np.hstack([np.zeros((len(measured), 0)), *H])

    def restart(self) -> None:
        for e in self.effects:
            e.restart()
        self.alarm.restart()
        self.power, self.beyond = 0.0, 0

    def faded(self, power: float, residual: np.ndarray, most: float = np.inf) -> float:
        """Return the power of residuals with a block taken in, in units of the noise."""
        fade = float(np.exp(-len(residual) / self.alarm.memory))
        good = residual[np.isfinite(residual)]
        return fade * power + (1.0 - fade) * min(float(np.mean((good / self.noise) ** 2)), most)


class GapMonitor:
    """Watch one muscle for an effect that appears during operation: a leak, friction, hysteresis.

    The healthy model predicts force and flow; its residuals are correlated with what each effect of the library would
    add. `calibrate` measures on a healthy stretch how large these sums are without a fault.

    Parameters
    ----------
    volume : VolumeModel
        The gas volume of the healthy muscle: ``volume_`` of a fitted model, or a classical volume.
    laws : sequence of Law
        What is watched: the law of force, of flow, or both.
    plant : Plant
        The bench that the effects refer to, ``BenchParameters.plant()``.
    hypotheses : sequence of str, pair or Effect
        Effects that may appear; those without a share in a law are left out of it.
    dt : float, default=0.001
        Sampling interval, s.
    memory : float, default=0.5
        Memory of the evidence, s.
    hold : float, default=1.2
        Seconds for which evidence must stay above its threshold before it is a finding; to identify it takes longer
        than to detect it.
    false_alarms_per_hour : float, default=1
        Allowed rate over all effects and equations, 1/h of signal.
    play : float, default=0
        Half the play through which friction and hysteresis follow the contraction, above the encoder's noise.
    block : int, default=20
        Samples taken at a time.

    See Also
    --------
    pamid.estimators.OnlineAdapter : The same filter for a model that follows a muscle.

    Examples
    --------
    >>> from pamid.bench import BenchParameters
    >>> from pamid.laws.thermodynamic import ThermodynamicFlow
    >>> from pamid.online import GapMonitor
    >>> from pamid.volume.braided import BraidedVolume
    >>> bench = BenchParameters.for_muscle("B")
    >>> geometry = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363)
    >>> monitor = GapMonitor(geometry, [ThermodynamicFlow()], bench.plant())  # then calibrate(table), update(table)
    """

    def __init__(
        self,
        volume: VolumeModel,
        laws: Sequence[Law],
        plant: Plant,
        hypotheses: Sequence[Any] = HYPOTHESES,
        *,
        dt: float = 1e-3,
        memory: float = 0.5,
        hold: float = 1.2,
        false_alarms_per_hour: float = 1.0,
        play: float = 0.0,
        block: int = 20,
    ) -> None:
        effects = [effect_of(h) for h in hypotheses]
        self.volume = volume
        self.dt = dt
        self.block = int(block)
        pairs = [(law, [e for e in effects if law.equation in e.hooks()]) for law in laws]
        tests = sum(len([p for p in e.parameters if p.linear]) or 1 for _, found in pairs for e in found) + len(pairs)
        if not tests or not all(value > 0 for value in (dt, memory, false_alarms_per_hour, block)):
            raise ParameterError(
                "The monitor has nothing to watch, or a time, rate or block that is not positive.",
                "laws, effects that enter them, and positive settings",
                "Correct the settings.",
            )
        self.settings = {
            "memory": memory / dt,
            "hold": max(hold / dt, 1.0),
            "limit": threshold(false_alarms_per_hour, memory, tests),
        }
        self.watches = [
            _Watch(law, [StreamedEffect(e, law.equation, plant, dt, play) for e in found], self.settings)
            for law, found in pairs
        ]
        self.sensors = StillSensors(self.block)
        self.calibrated = False

    @property
    def least(self) -> int:
        """Least number of samples of a healthy stretch."""
        return BLOCKS * self.block

    @property
    def stuck(self) -> dict[str, float]:
        """Channels whose sensor is stuck, with the time since when, s; they are left out."""
        return self.sensors.stuck

    def calibrate(self, table: Any) -> Self:
        """Learn from a healthy stretch: scale and offset of the model, its noise, and the size of the evidence; return
        itself.

        The table has the columns ``eps``, ``deps``, ``P``, ``dP`` and the measured ``F`` and ``mdot``, a minute or
        more.
        """
        state, measured = self._columns(table)
        n = len(state.eps)
        if n < self.least:
            raise EmptyLogError(
                f"The healthy stretch has {n} samples.",
                f"at least {self.least}, better a minute of signal",
                "Record a longer healthy stretch.",
            )
        self.sensors.learn(self._channels(state, measured))
        for watch, y in zip(self.watches, measured, strict=True):
            watch.factor, watch.offset = 1.0, 0.0
            modelled = np.asarray(watch.law.predict(*self.volume.jet(state), state))
            watch.factor, watch.offset = _line(modelled, y)
            residual, H = watch.residual(self.volume, state, y)
            watch.noise = max(float(1.4826 * np.nanmedian(np.abs(residual))), 1e-12 * (np.nanmax(np.abs(y)) or 1.0))
            blocks = [slice(i, i + self.block) for i in range(0, n - self.block + 1, self.block)]
            for b in blocks:
                residual[b] = _tamed(residual[b], watch.noise)
            # Evidence for an effect in healthy operation is not an alarm later.
            known = np.isfinite(residual) & np.isfinite(H).all(axis=1)
            size = np.sqrt(np.mean(H[known] ** 2, axis=0))
            size[size == 0] = 1.0
            start = np.linalg.lstsq(H[known] / size, residual[known], rcond=1e-6)[0] / size
            watch.start = start
            residual = residual - H @ start
            told = [watch.alarm.statistic(H[b], residual[b], watch.noise) for b in blocks]
            watch.alarm.calibrate(np.reshape(told, (len(blocks), H.shape[1])))
            power = self._powers(watch, residual, blocks)
            watch.power_scale = float(np.mean(power) + self.settings["limit"] * np.std(power))
            watch.power_scale = max(watch.power_scale, 1.5 * float(np.max(power)))
            watch.restart()
        self.calibrated = True
        return self

    def _powers(self, watch: _Watch, residual: np.ndarray, blocks: list[slice]) -> np.ndarray:
        out = [0.0]
        for b in blocks:
            if np.isfinite(residual[b]).any():
                out.append(watch.faded(out[-1], residual[b]))
        return np.array(out[1:])

    def update(self, table: Any) -> list[Finding]:
        """Take the next samples, in their order; return the alarms raised in them, at most one per block and equation.

        The table is as for `calibrate`, with ``time`` (s) for the findings if there is one.
        """
        if not self.calibrated:
            raise ParameterError(
                "The monitor is not calibrated.", "a healthy stretch first", "Call calibrate with one."
            )
        state, measured = self._columns(table)
        time = np.asarray(table["time"], dtype=float) if "time" in table else np.arange(len(state.eps)) * self.dt
        found = []
        still = self.sensors.update(self._channels(state, measured), time)
        for watch, y in zip(self.watches, measured, strict=True):
            raw, H = watch.residual(self.volume, state, y)
            residual = raw - H @ watch.start
            residual[still["eps"] | still["P"] | still[watch.law.target]] = np.nan
            for i in range(0, len(y), self.block):
                b = slice(i, i + self.block)
                finding = self._block(watch, H[b], residual[b], float(time[b][-1]))
                if finding is not None:
                    found.append(finding)
        return sorted(found, key=lambda f: f.time)

    def _block(self, watch: _Watch, H: np.ndarray, residual: np.ndarray, time: float) -> Finding | None:
        residual = _tamed(residual, watch.noise)
        if not np.isfinite(residual).any():
            return None
        named = watch.alarm.update(H, residual, watch.noise) if H.shape[1] else None
        # A jolt is short; the evidence of one block is limited so that it takes several to raise an alarm.
        watch.power = watch.faded(watch.power, residual, 5.0 * watch.power_scale)
        beyond = watch.power > watch.power_scale
        watch.beyond = watch.beyond + len(residual) if beyond else 0
        if named is not None:
            which, strength = named
            effect, _, unit = watch.names[which]
            value = watch.alarm.estimate(which)
            return Finding(effect, watch.law.equation, time, strength, value, unit)
        # A residual that grew without explanation: held longer, so that an effect can be named first.
        if watch.beyond >= 2 * self.settings["hold"]:
            strength = watch.power / watch.power_scale
            return Finding("unknown", watch.law.equation, time, strength, float("nan"), watch.law.unit)
        return None

    def restart(self) -> None:
        """Take the next samples as another run; the calibration stays."""
        for watch in self.watches:
            watch.restart()

    def _channels(self, state: State, measured: list[np.ndarray]) -> dict[str, np.ndarray]:
        return {
            "eps": state.eps,
            "P": state.P,
            **{w.law.target: y for w, y in zip(self.watches, measured, strict=True)},
        }

    def _columns(self, table: Any) -> tuple[State, list[np.ndarray]]:
        needed = [*STATE_SIGNALS, *(w.law.target for w in self.watches)]
        if missing := [c for c in needed if c not in table]:
            raise MissingColumnError(
                f"The samples have no {', '.join(missing)}.", f"the columns {', '.join(needed)}", "Add them."
            )
        state = State(*(np.asarray(table[s], dtype=float) for s in STATE_SIGNALS))
        return state, [np.asarray(table[w.law.target], dtype=float) for w in self.watches]


def _line(modelled: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
    """Return factor and offset of the model that fit the measurements, robust to a few outliers."""
    known = np.isfinite(measured) & np.isfinite(modelled)
    unit = float(np.std(measured[known])) or 1.0
    factor, offset = 1.0, 0.0
    for _ in range(5):
        A = np.column_stack([modelled[known], np.full(known.sum(), unit)])
        factor, share = np.linalg.lstsq(A, measured[known], rcond=None)[0]
        offset = share * unit
        size = np.abs(measured - factor * modelled - offset)
        kept = np.isfinite(size) & (size <= WILD * 1.4826 * np.median(size[known]))
        if kept.sum() < 3 or (kept == known).all():
            break
        known = kept
    return float(factor), float(offset)


def _tamed(residual: np.ndarray, noise: float) -> np.ndarray:
    """Leave single wild samples of a block out: they are a sensor's fault; more of them together are a change."""
    good = np.isfinite(residual)
    wild = good & (np.abs(residual) > WILD * noise)
    return np.where(wild, np.nan, residual) if 0 < wild.sum() < 0.2 * good.sum() else residual
