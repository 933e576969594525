"""An effect along a stream: its contribution to each sample, its memory carried from block to block."""

from typing import Any

import numpy as np

from ..effects._terms import added
from ..effects.base import Effect, Signals
from ..effects.plant import Plant
from ..errors import IncompatibleError
from ..signals.paths import play, reversals
from ..signals.state import State

STEP = 1e-4
"""Step of the derivative by a parameter that is not linear, as a share of its range."""


class StreamedEffect:
    """One effect in one equation, sample after sample.

    Parameters
    ----------
    effect : Effect
        The effect, with the values at which its parameters start.
    equation : {"force", "flow"}
        The equation in which it is followed.
    plant : Plant
        The bench.
    dt : float
        Sampling interval, s.
    play : float, default=0
        Half the play through which the position is followed, so that an encoder's noise is no motion back and forth.

    Attributes
    ----------
    names : list of str
        Parameters that are followed: the linear ones, or all of an effect that has none.

    Examples
    --------
    >>> from pamid.bench import BenchParameters
    >>> from pamid.effects import make_effect
    >>> from pamid.online import StreamedEffect
    >>> leak = StreamedEffect(make_effect("leakage"), "flow", BenchParameters.for_muscle("B").plant(), dt=1e-3)
    >>> leak.linear
    ['conductance']
    """

    def __init__(self, effect: Effect, equation: str, plant: Plant, dt: float, play: float = 0.0) -> None:
        if equation not in effect.hooks() or effect.sampled:
            raise IncompatibleError(
                f"The effect {effect.name} adds nothing to the {equation} of one muscle.",
                f"an effect with a share in {equation}",
                "Choose another effect or equation.",
            )
        self.effect = effect
        self.equation = equation
        self.plant = plant
        self.dt = dt
        self.play = play
        self._followed = [p for p in effect.parameters if p.linear] or list(effect.parameters)
        self.linear = [p.name for p in self._followed if p.linear]
        self.names, self.units = [p.name for p in self._followed], [p.unit for p in self._followed]
        self.lower, self.upper = np.array([[p.lower, p.upper] for p in self._followed]).T
        self.restart()

    def restart(self) -> None:
        """Reset: what follows is another run."""
        self.memory: Any = None
        self.last: Signals | None = None

    @property
    def state(self) -> dict[str, Any]:
        """What the effect remembers, as numbers and arrays."""
        if self.memory is None or self.last is None:
            return {}
        last = {
            role: float(v) for role in ("position", *self.effect.roles) if (v := getattr(self.last, role)) is not None
        }
        return {"memory": np.array(self.memory, dtype=float), "last": last}

    def recall(self, state: dict[str, Any]) -> None:
        """Continue from what `state` returned."""
        self.memory = state.get("memory")
        self.last = Signals(**state["last"]) if state else None

    def linearised(self, state: State, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Advance over a block; return the contribution (N or kg/s) at present values of the followed parameters, and
        its derivatives by them, shape (n_samples, n_parameters).
        """
        s = Signals.of_state(state)
        memory = self._along(s)
        n = len(state.eps)
        if self.linear:
            columns = []
            for p in self._followed:
                # Parameters are bounded, so a proportional one is evaluated where it is surely allowed.
                unit = p.nominal if p.nominal else min(max(1.0, p.lower), p.upper)
                alone = self.effect.replace(**{**dict.fromkeys(self.linear, 0.0), p.name: unit})
                columns.append(self._share(alone, s, memory, n) / unit)
            derivatives = np.column_stack(columns)
            return derivatives @ values, derivatives
        inside = np.clip(values, self.lower, self.upper)
        here = self._share(self._with(inside), s, memory, n)
        columns = []
        for k in range(len(self.names)):
            h = STEP * (self.upper[k] - self.lower[k])
            ends = [np.clip(inside[k] + d, self.lower[k], self.upper[k]) for d in (-h, h)]
            shares = [self._share(self._with(_replaced(inside, k, v)), s, memory, n) for v in ends]
            columns.append((shares[1] - shares[0]) / (ends[1] - ends[0]))
        return here, np.column_stack(columns)

    def _with(self, values: np.ndarray) -> Effect:
        return self.effect.replace(**{n: float(v) for n, v in zip(self.names, values, strict=True)})

    def _share(self, effect: Effect, s: Signals, memory: Any, n: int) -> np.ndarray:
        return np.broadcast_to(np.asarray(added(effect, self.equation, s, memory, self.plant), dtype=float), n)

    def _along(self, s: Signals) -> Any:
        """Return the memory at each sample of a block and keep it for the next."""
        if not self.effect.n_states:
            return np.zeros((0,))
        return self._along_path(s) if self.effect.path_dependent else self._along_time(s)

    def _along_path(self, s: Signals) -> np.ndarray:
        """Return memory that the path of the position alone decides: one step a reversal."""
        x = _held(np.asarray(s.position, dtype=float), None if self.last is None else self.last.position)
        if self.memory is None or self.last is None:
            self.last = Signals(position=float(x[0]))
            self.memory = np.asarray(self.effect.start(self.last, self.plant, self.dt))
        x = play(np.concatenate([[self.last.position], x]), self.play)
        turns = reversals(x)
        states = np.empty((self.effect.n_states, len(turns)))
        states[:, 0] = state = self.memory
        for k in range(1, len(turns)):
            before, now = Signals(position=x[turns[k - 1]]), Signals(position=x[turns[k]])
            states[:, k] = state = self.effect.step(state, before, now, self.dt, self.plant)
        last = np.maximum(np.searchsorted(turns, np.arange(len(x)), side="left") - 1, 0)
        out = self.effect.step(
            states[:, last], Signals(position=x[turns[last]]), Signals(position=x), self.dt, self.plant
        )
        self.memory, self.last = out[:, -1], Signals(position=float(x[-1]))
        return out[:, 1:]

    def _along_time(self, s: Signals) -> np.ndarray:
        out = np.empty((self.effect.n_states, len(s.position)))
        used = Signals(**{role: np.asarray(getattr(s, role)) for role in self.effect.roles})
        for k in range(out.shape[1]):
            now = used.at(k)
            if not all(np.isfinite(getattr(now, role)) for role in self.effect.roles):
                out[:, k] = np.nan if self.memory is None else self.memory
                continue  # missing samples do not enter the memory
            if self.memory is None or self.last is None:
                self.memory = np.asarray(self.effect.start(now, self.plant, self.dt))
            else:
                self.memory = self.effect.step(self.memory, self.last, now, self.dt, self.plant)
            self.last = now
            out[:, k] = self.memory
        return out


def _held(x: np.ndarray, before: float | None) -> np.ndarray:
    """Return a signal whose missing values are the last one before them."""
    known = np.isfinite(x)
    if known.all():
        return x
    at = np.maximum.accumulate(np.where(known, np.arange(len(x)), -1))
    first = before if before is not None else float(x[known][0]) if known.any() else 0.0
    return np.where(at >= 0, x[np.maximum(at, 0)], first)


def _replaced(values: np.ndarray, k: int, value: float) -> np.ndarray:
    out = values.copy()
    out[k] = value
    return out
