r"""The effect of causes on noise: sensor faults that are undone filter it, and forces jump where noisy readings turn.

Where a fault is undone in a reading, its noise is filtered, too. A gain changes readings and noise alike,

.. math:: a = \frac{\operatorname{rms}(T y)}{\operatorname{rms}(y)}, \qquad
    s = \frac{\operatorname{rms}(T n)}{\operatorname{rms}(n)}, \qquad s = a,

and that residuals become smaller with their noise is no evidence: they are in units of the noise that is left, to first
order and in every fit, too. Undoing a lag or a resonance amplifies fast noise more than motion, and the noise then
hides what is modelled: each window costs :math:`\log(s/a)`.

A force follows readings with their noise :math:`n`: dry friction turns some rows early or late, and misses up to twice
its size there. The noise of a window is then

.. math:: \sigma'^2 = \sigma^2 + \sum_i \operatorname{E}\bigl[(f_i(y + n) - f_i(y))^2\bigr]

with the force of each cause on copies of the log, and each window costs :math:`\log(\sigma'/\sigma)`: without it, right
causes leave more than the noise, and wrong ones that turn less are preferred.

References
----------
R. J. Carroll et al., Measurement Error in Nonlinear Models, 2nd ed., CRC, 2006. https://doi.org/10.1201/9781420010138
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from ...equations.windows import average
from ...remembered import Remembered
from ...simulators.base import Simulator
from ...simulators.placement import Placement
from ..settings import LEAST_GAIN, TOLERANCE
from .balance import Balance
from .ports import PortEvidence
from .protocol import Active, Spec
from .tolerances import SMALL, rms
from .turned import Turned
from .window_noise import NEAR


class UndoneEvidence(PortEvidence, ABC):
    """Residuals under effects that change the noise: undone in readings, or forces that follow these."""

    _spreads: Remembered[tuple[np.ndarray, np.ndarray]]
    _moved: Remembered[tuple[np.ndarray, np.ndarray]]
    _jumps: dict[str, np.ndarray]
    _tables: list[dict[str, np.ndarray]]
    balances: list[Balance]
    _x: np.ndarray
    _first: list[list[np.ndarray]]
    _moving: list[np.ndarray]
    _turned: Turned | None

    @abstractmethod
    def _residual(
        self, active: Active, numbers: np.ndarray, channels: Mapping[str, np.ndarray] | None = None,
        followed: dict[str, np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return measured less modelled at every window; effects may follow other signals than the simulator."""

    @abstractmethod
    def _motion(self, channels: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the states at each row, and all signals by name."""

    def _as_tested(self, parts: list[np.ndarray]) -> np.ndarray:
        """Return the windows of the balances as they are tested: as forces, where joints move."""
        parts = parts if self._turned is None else self._turned(parts)
        return np.concatenate([r[moves] for r, moves in zip(parts, self._moving, strict=True)])

    def left(self, simulator: Simulator, channels: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
        """Return white residuals of the simulator with other numbers, on the log or on fault-free simulated signals."""
        own = [one for one in self.made_as(simulator) if channels is None or one[0].acts]
        return self.white(self._finite(self._residual(own, simulator.numbers, channels)) / self.noise)

    def made_as(self, simulator: Simulator) -> Active:
        """Return the effects of the simulator with other numbers, made, where they can act on the log."""
        there = [(self.placements.get(f"{name}@{where}"), values) for name, where, values in simulator.effects]
        return [(place, place.made(values)) for place, values in there if place is not None]

    def _under_inputs(self, u: np.ndarray) -> np.ndarray:
        """Return the change of the residuals under other inputs."""
        numbers, other = self.simulator.numbers, dict(zip(self.simulator.inputs, u, strict=True))
        return self._residual(self._own, numbers, {**self.log.channels, **other}) - self._residual(self._own, numbers)

    @property
    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """The states and inputs at each row, shapes (n_states, n) and (n_inputs, n)."""
        return self._x, self._u

    @cached_property
    def pulled(self) -> tuple[float, float]:
        """The most nats that a parameter gains from noise in modelled rates, by itself and with all others.

        It is asked without the simulator's own effects, so that a corrected simulator is judged like the given one.
        """
        return self._pulled({}, np.zeros(len(self.free)), [])

    def pulled_under(self, spec: Spec, x: np.ndarray) -> tuple[float, float]:
        """Return the same under effects, whose sizes give way, too."""
        return self._pulled(spec, x, self.active(spec))

    def _pulled(self, spec: Spec, x: np.ndarray, active: Active) -> tuple[float, float]:
        r"""Return the same under effects, of which some have free sizes.

        With slopes S of the white residuals, S' of a noisier copy and its change d, noise pulls by
        :math:`g = (S' - S)^T d` (errors in variables), and a fit gains
        :math:`\tfrac12 g^T (S^T S + \text{prior})^{-1} g` by following: where parameters compensate each other,
        they give way together.
        """
        weights = np.concatenate([np.full(p.stop - p.start, w) for p, w in zip(self.parts, self.weights, strict=True)])
        copy, there = self._copies[0], dict(zip(self.free, map(float, x), strict=False))  # a free step comes last
        numbers = self.numbers(there)
        # Noise in what an effect follows is known window by window, and pulls nothing.
        quiet = self._motion({name: self._truth(name, self.log.channels, active) for name in self.log.channels})[1]
        plain, noisy = self._residual(active, numbers), self._residual(active, numbers, copy, quiet)
        moved = weights * self._whitening.white((noisy - plain) / self.noise)
        steps = [(active, self.numbers({**there, k: there[k] + SMALL})) for k in self.free if k not in self.skews]
        tolerances = len(steps)
        steps += [
            (self.active({**spec, name: {**values, p.name: (1.0 - SMALL) * values[p.name]}}), numbers)
            for name, values in spec.items() for p in self.effects[name].parameters
            if p.linear and values.get(p.name)
        ]  # fmt: skip
        pull, slopes = np.zeros(len(steps)), np.zeros((len(moved), len(steps)))
        for k, (near, at) in enumerate(steps):
            change = self._residual(near, at) - plain
            turned = self._residual(near, at, copy, quiet) - noisy - change
            slopes[:, k] = self._whitening.white(change / self.noise) / SMALL
            pull[k] = self._whitening.white(turned / self.noise) @ moved / SMALL
        aside = self.J[:, [k for k, name in enumerate(self.free) if name in self.skews]]
        pull, slopes = np.append(pull, np.zeros(aside.shape[1])), np.column_stack([slopes, aside])
        information = slopes.T @ (weights[:, None] * slopes)
        alone = np.square(pull) / np.maximum(np.diag(information), 1e-300)
        prior = np.full(len(pull), TOLERANCE)
        prior[tolerances : len(steps)] = 0.0
        together = pull @ np.linalg.lstsq(information + np.diag(prior), pull, rcond=1e-12)[0]
        return 0.5 * float(np.max(alone, initial=0.0)), 0.5 * float(together)

    def _noise_pulls(self) -> bool:
        found = max(self.pulled) > LEAST_GAIN
        del self.pulled  # what is free changes
        return found

    def _noise_as(self, active: Active) -> np.ndarray:
        """Return the noise of each window in readings from which faults without memory are undone."""
        if not any(self._scales(place) for place, _ in active[len(self._own) :]):
            return self.noise
        out, own = self.noise.copy(), self._measured_noise(self._own)
        for part, usual, new in zip(self.parts, own, self._measured_noise(active), strict=True):
            if usual > 0.0 and 0.0 < new < np.inf:
                out[part] *= new / usual
        return out

    def _measured_noise(self, active: Active) -> list[float]:
        """Return the noise of the measured side of each equation, faults without memory undone."""
        faults = [(place, made) for place, made in active if self._scales(place)]
        x, copy = self.log.channels, self._copies[-1]
        changes = (self._truth(b.channel, copy, faults) - self._truth(b.channel, x, faults) for b in self.balances)
        return [rms(self._rates_of(b, k, n)) for k, (b, n) in enumerate(zip(self.balances, changes, strict=True))]

    def _truth(self, channel: str, readings: Mapping[str, np.ndarray], active: Active) -> np.ndarray:
        """Return a channel with the faults of its readings undone."""
        x = readings[channel]
        for place, made in active:
            if channel in place.readings and channel in self.simulator.states:
                x = place.truth(made, x, self.log.dt, self.log.starts)
        return x

    def _rates_of(self, b: Balance, place: int, y: np.ndarray) -> np.ndarray:
        """Return the measured side of an equation, of some signal, at all its windows."""
        runs = [(b.rate(y[a:e], self.log.dt), f) for (a, e), f in zip(self.log.spans, self._first[place], strict=True)]
        return np.concatenate([average(rate, self.n, b.order + 1, first) for rate, first in runs])

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return the relative width of the noise under effects that filter it or follow it; None without any."""
        found = self._noise_under({k: v for k, v in spec.items() if self._changes_noise(self.placements[k])})
        return None if found is None else found[0]

    def glance(self, spec: Spec) -> np.ndarray:
        """Return what effects change; of a fault in a reading, how it changes the measured side of the equations."""
        [(name, values)], log = spec.items(), self.log
        place = self.placements[name]
        if place.enters != "output" or place.at not in self.simulator.states:
            return super().glance(spec)
        x = log.channels[place.at]
        error = x - place.reading(place.effect(**values), x, log.dt, log.starts)  # of truths to first order
        parts = [
            self._rates_of(b, k, error if b.channel == place.at else np.zeros(log.n))
            for k, b in enumerate(self.balances)
        ]
        return self._whitening.white(self._as_tested(parts) / self.noise)

    def drowns(self, spec: Spec) -> bool:
        """Return whether undoing faults of readings adds more noise to an equation than the readings bring."""
        faults = {k: v for k, v in spec.items() if self.placements[k].enters == "output"}
        grown = self.widening(faults) if faults else None
        return grown is not None and max(rms(grown[part]) for part in self.parts) > np.sqrt(2.0)

    def hides(self, spec: Spec) -> bool:
        """Return whether effects do so in a quarter of the windows, too many for a robust fit to leave them aside."""
        grown = self.widening(spec)
        return grown is not None and any(
            np.quantile(grown[p], 0.75) > np.sqrt(2.0) for p in self.parts if len(grown[p])
        )

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return the growth of noise over that of motion under effects; None where none changes it."""
        # What forces add is counted window by window, since dry friction jumps in few of them.
        jumps = self._jump(spec)
        undone = {k: v for k, v in spec.items() if not self.placements[k].acts}
        found = self._noise_under({k: v for k, v in undone.items() if self._changes_noise(self.placements[k])})
        if jumps is None:
            return None if found is None else found[1]
        return jumps if found is None else found[1] * jumps

    def _jump(self, spec: Spec) -> np.ndarray | None:
        """Return the growth of noise by forces that follow noisy readings; None without such forces."""
        power = [self._power(name, values) for name, values in spec.items() if self.placements[name].acts]
        noise = self._noise_as(self.active(spec)) / self.noise
        return np.sqrt(1.0 + np.sum(power, axis=0) / np.square(noise)) if power else None

    def _power(self, name: str, values: Mapping[str, float]) -> np.ndarray:
        """Return the mean square change of the residuals by noise in the inputs of a force, in units of their noise."""
        place = self.placements[name]
        size = float(np.linalg.norm([values[p.name] for p in place.effect.parameters if p.linear]))
        if not size > 0.0:
            return np.zeros(len(self.noise))
        # To one digit: the noise of a force hardly depends on its shape, and its size is a factor.
        key = " ".join(
            [name, *(f"{values[p.name] / (size if p.linear else 1.0):.0e}" for p in place.effect.parameters)]
        )
        if key not in self._jumps:
            if not self._tables:
                self._tables = [self._motion(copy)[1] for copy in self._copies]
            active: Active = [(place, place.effect(**values))]
            numbers = self.simulator.numbers
            plain = self._residual(active, numbers)
            changes = [self._residual(active, numbers, followed=table) - plain for table in self._tables]
            self._jumps[key] = np.mean(np.square(changes), axis=0) / size**2
        return self._jumps[key] * np.square(size / self.noise)

    def _noise_under(self, spec: Spec) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the relative width of the noise under all effects of a set, and its growth over that of motion."""
        if not spec:
            return None

        def made() -> tuple[np.ndarray, np.ndarray]:
            drawn, changed = self._noisier(spec)
            scale, grown = np.ones(len(self.value)), np.ones(len(self.value))
            active = self.active(spec)
            for part, a, slopes in zip(self.parts, self._amplified(active), self._steep(active), strict=True):
                usual, new = rms(drawn[part]), rms(changed[part])
                if usual > 0.0 and new > 0.0:
                    s = slopes * (new / usual / rms(slopes))
                    scale[part] = np.minimum(a, s)
                    grown[part] = np.maximum(1.0, s / a)
            return scale, grown

        return self._spreads.get(_key(spec), made)

    def filtered(self, spec: Spec, z: np.ndarray) -> np.ndarray | None:
        """Return residuals filtered as undoing faults of readings filters their noise; None without such faults."""
        faults = {k: v for k, v in spec.items() if self._filters(self.placements[k])}
        if not faults:
            return None
        drawn, changed = self._noisier(faults)
        out = np.array(z, dtype=float)
        for part in self.parts:
            near = _neighbours(drawn[part])
            taps = np.linalg.lstsq(near, changed[part], rcond=1e-9)[0]
            # Noise of several readings is filtered by no one filter: what that misses is not made quieter.
            size = rms(near @ taps)
            out[part] = _neighbours(out[part]) @ taps * (rms(changed[part]) / size if size > 0.0 else 1.0)
        return out

    def scales_noise(self, spec: Spec) -> bool:
        """Return whether undoing faults of readings changes their noise, which first order takes for evidence."""
        log = self.log
        for name, values in spec.items():
            place = self.placements[name]
            for channel in set(place.readings) & set(self.simulator.states) & set(log.channels):
                x, copy = log.channels[channel], self._copies[-1][channel]
                truth, noisier = (place.truth(place.effect(**values), y, log.dt, log.starts) for y in (x, copy))
                if not np.allclose(noisier - truth, copy - x):
                    return True
        return False

    def _noisier(self, spec: Spec) -> tuple[np.ndarray, np.ndarray]:
        """Return the change of the residuals by more noise, without and under effects, white as they are judged."""

        def made() -> tuple[np.ndarray, np.ndarray]:
            numbers, copy = self.simulator.numbers, self._copies[-1]
            usual, changed = (
                (self._residual(active, numbers, copy) - self._residual(active, numbers)) / self._noise_as(active)
                for active in (self._own, self.active(spec))
            )
            return self._whitening.white(usual), self._whitening.white(changed)

        return self._moved.get(_key(spec), made)

    def _lay_again(self) -> None:
        self._moved.clear()
        self._spreads.clear()
        super()._lay_again()

    def _filters(self, place: Placement) -> bool:
        """Return whether undoing a fault in the reading of a state filters its noise."""
        return bool(set(place.readings) & set(self.simulator.states)) and place.effect.filters_readings()

    def _changes_noise(self, place: Placement) -> bool:
        """Return whether an effect follows noisy readings as the model does, so that both may cancel."""
        follows = place.acts and not place.effect.path_dependent
        return place.enters == "parameter" or follows or bool(set(place.readings) & set(self.simulator.states))

    def _steep(self, active: Active) -> list[np.ndarray]:
        """Return by how much faults without memory, once undone, amplify the noise of a reading in each window."""
        faults, x, found = [(place, made) for place, made in active if self._scales(place)], self.log.channels, []
        for k, (b, moves) in enumerate(zip(self.balances, self._moving, strict=True)):
            h = SMALL * self.channel_noise(b.channel)
            low, high = (self._truth(b.channel, {b.channel: x[b.channel] + way}, faults) for way in (-h, h))
            power = np.square((high - low) / (2.0 * h))
            runs = [(power[a:e], first) for (a, e), first in zip(self.log.spans, self._first[k], strict=True)]
            steep = np.concatenate([average(p, self.n, b.order + 1, first) for p, first in runs])[moves]
            found.append(np.sqrt(np.where(steep > 0.0, steep, 1.0)))  # behind a limit nothing is read
        return found

    def _scales(self, place: Placement) -> bool:
        """Return whether undoing a fault in the reading of a state scales its noise and filters nothing."""
        return bool(set(place.readings) & set(self.simulator.states)) and not place.effect.filters_readings()

    def _amplified(self, active: Active) -> list[float]:
        """Return by how much effects that are undone amplify the measured side of each equation beyond its noise."""
        x, found = self.log.channels, []
        noise = self._noise_as(active) / self.noise
        for k, (b, part) in enumerate(zip(self.balances, self.parts, strict=True)):
            usual, new = (rms(self._rates_of(b, k, self._truth(b.channel, x, a))) for a in (self._own, active))
            found.append(new / usual / float(np.mean(noise[part])) if usual > 0.0 and part.stop > part.start else 1.0)
        return found


def _key(spec: Spec) -> str:
    return repr({name: dict(values) for name, values in spec.items()})


def _neighbours(z: np.ndarray) -> np.ndarray:
    """Return each window's residual and those of its neighbours on both sides, shape (n, 2 NEAR + 1)."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(z, NEAR), 2 * NEAR + 1)
