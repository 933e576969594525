"""The power of a signal's unit in each parameter of an effect."""

from __future__ import annotations

import itertools
import re
import traceback
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ..effects import Effect, Parameter, Signals
from ..effects.plant import Surroundings
from ..errors import EffectError, PamidError

_SHRUNK = 0.6
_STARTS = np.array([0])
_TIME = np.linspace(0.0, 3.0, 80)
_NOTHING: Any = Surroundings()
_PRODUCT = re.compile(r"[-A-Za-z ^0-9/()*.·²³⁻¹−]*")
_POWERS = str.maketrans("²³⁻¹−", "23-1-")


@cache
def powers(effect: type[Effect], hook: str) -> dict[str, int] | None:
    """Return the power of the signal's unit in each parameter of an effect, so that both scale together."""
    if hook == "force" and effect.site == "joint":  # an angle is an angle
        return dict.fromkeys((p.name for p in effect.parameters), 0)
    if hook == "force":
        declared = {p.name: p.position for p in effect.parameters}
        return (
            declared
            if _scales(effect, hook, declared, {p.name: _generic(p, True) for p in effect.parameters})
            else None
        )
    for fill in (True, False):
        values = {p.name: _generic(p, fill) for p in effect.parameters}
        choices = [_possible(p) for p in effect.parameters]
        for some in sorted(itertools.product(*choices), key=sum):
            named = dict(zip(values, some, strict=True))
            if _scales(effect, hook, named, values):
                return named
    return None


def _scales(effect: type[Effect], hook: str, named: Mapping[str, int], values: Mapping[str, float]) -> bool:
    """Return whether an effect does the same to a smaller signal, its parameters changed by powers of the factor."""
    does = {"force": _force, "command": _command, "measure": _reading}[hook]
    wanted = _quietly(does, effect, values, 1.0)
    if wanted is None or not np.any(wanted):
        return False
    found = _quietly(does, effect, {k: v * _SHRUNK ** named[k] for k, v in values.items()}, _SHRUNK)
    return found is not None and bool(np.allclose(found, wanted, rtol=1e-6, atol=1e-9 * float(np.max(np.abs(wanted)))))


def _possible(p: Parameter) -> tuple[int, ...]:
    """Return the powers of the signal's unit that a parameter may have."""
    if p.position:
        return (p.position,)
    return (0,) if p.unit == "s" or p.share else (0, 1)


def _generic(p: Parameter, fill: bool) -> float:
    """Return a value of a parameter at which its influence shows; nominal ones otherwise."""
    value = p.nominal
    if not value and fill:
        value = 0.4 if p.share else min(0.1 * p.upper, 10.0)
    return float(np.clip(value, p.lower, p.upper))


def _quietly(does: Any, effect: type[Effect], values: Mapping[str, float], scale: float) -> np.ndarray | None:
    try:
        with np.errstate(all="ignore"):
            return np.asarray(does(effect(**values), scale), dtype=float)
    except PamidError:  # it reads a number of a muscle, or a value is outside its bounds
        return None
    except Exception as error:  # whatever a user's effect raises
        at = traceback.extract_tb(error.__traceback__)[-1]
        raise EffectError(
            f"The effect {effect.name} has failed with {type(error).__name__}: {error} "
            f"({at.filename}, line {at.lineno}).",
            f"elementwise functions of numpy, of the signals in its roles: {', '.join(effect.roles) or 'none'}",
            "Correct its code.",
        ) from error


def _force(made: Effect, scale: float) -> Any:
    t = _TIME
    s = Signals(
        time=t,
        position=scale * (0.1 + 0.03 * np.sin(3.0 * t) + 0.015 * np.sin(7.0 * t)),
        velocity=scale * (0.09 * np.cos(3.0 * t) + 0.105 * np.cos(7.0 * t)),
        pressure=3e5 + 1e5 * np.sin(2.0 * t),
        pressure_rate=2e5 * np.cos(2.0 * t),
        flow=1e-4 * np.cos(4.0 * t),
        command=np.sin(4.0 * t),
        force=20.0 + 10.0 * np.cos(5.0 * t),
    )
    x = made.trace(s, _NOTHING, t[1], _STARTS)
    return made.push(s, x, _NOTHING) + np.zeros(80)


def _command(made: Effect, scale: float) -> Any:
    s = Signals(time=_TIME, command=scale * np.sin(4.0 * _TIME))
    return made.command(s.command, s, made.trace(s, _NOTHING, _TIME[1], _STARTS), _NOTHING) / scale - s.command / scale


def _reading(made: Effect, scale: float) -> Any:
    y = 1000.0 * scale * np.sin(4.0 * _TIME)  # larger than any typical limit
    s = Signals(time=_TIME, position=y, force=y, flow=y, pressure=y)
    x = made.trace(s, _NOTHING, _TIME[1], _STARTS) if made.n_states else np.zeros((0,))
    return made.measure(y, x) / scale - y / scale


def unit_powers(unit: str) -> dict[str, int]:
    """Return a unit as powers of its words: m^3, m**3, m³ and m3 are the same."""
    above, _, below = unit.translate(_POWERS).partition("/")
    found: dict[str, int] = {}
    for part, sign in ((above, 1), (below, -1)):
        for word, power in re.findall(r"([A-Za-z]+(?:\d[A-Za-z]+)*)(?:(?:\^|\*\*)?(-?\d+))?", part):
            found[word] = found.get(word, 0) + sign * int(power or 1)
    return {k: v for k, v in found.items() if v}


def unit_text(factors: Sequence[tuple[str, float]]) -> str:
    """Return a product of units with powers as text."""
    total: dict[str, float] = {}
    for unit, power in factors:
        plain = unit not in ("", "-", "1")
        for word, own in (unit_powers(unit) if _PRODUCT.fullmatch(unit) else {unit: 1}).items():
            if plain:
                total[word] = total.get(word, 0) + own * power
    top = [w if n == 1 else f"{w}^{n}" for w, n in total.items() if n > 0]
    bottom = [w if n == -1 else f"{w}^{-n}" for w, n in total.items() if n < 0]
    if not bottom:
        return " ".join(top) or "-"
    return f"{' '.join(top) or '1'}/{bottom[0] if len(bottom) == 1 else '(' + ' '.join(bottom) + ')'}"
