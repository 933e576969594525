"""The run that would confirm the finding of a monitor."""

from collections.abc import Mapping

import numpy as np

from ...bench import simulate, sine
from ...bench.parameters import BenchParameters
from ...effects import all_effects
from ..diagnosis.rivals import Rival
from .family import DesignedRun, Limits
from .search import plan_next

LIKE = {
    "force": ("coulomb_friction", "viscous_friction", "hysteresis", "bladder_elasticity", "force_bias"),
    "flow": ("leakage", "flow_bias", "dead_volume", "gas_temperature"),
    "valve": ("valve_conductance", "supply_droop", "valve_dead_zone"),
    "joint": ("joint_damping", "gravity", "inertia"),
}
"""Effects of each equation that are most often confused."""
MOST = 3


def confirming(
    effect: str,
    params: BenchParameters,
    values: Mapping[str, float] | None = None,
    *,
    seconds: float = 2.0,
    designs: int = 16,
    seed: int = 0,
) -> DesignedRun | None:
    """Return the run that best distinguishes an effect from those most often confused with it."""
    library = all_effects()
    if effect not in library:
        return None
    equation = next((e for e in library[effect].equations if e in LIKE), "flow")
    others = [name for name in LIKE[equation] if name != effect and name in library][:MOST]
    sizes = {effect: _values(effect, values or {}), **{name: _values(name, {}) for name in others}}
    rivals = [Rival({name: its}, {}, 0.0, 1.0) for name, its in sizes.items()]
    healthy = simulate(params, [sine(4.0, 10.0, 600), sine(1.0, 15.0, 600)], seed=seed)
    limits, asked = Limits(seconds=seconds), "discriminate"
    plan = plan_next(rivals, {"healthy": healthy}, params, limits, designs=designs, purpose=asked, seed=seed)
    return plan.runs[0] if plan.runs else None


def _values(name: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of an effect: given ones within their bounds, typical ones otherwise."""
    found = {}
    for p in all_effects()[name].parameters:
        value = float(given.get(p.name, p.nominal))
        found[p.name] = float(np.clip(value, p.lower, p.upper)) if np.isfinite(value) else float(p.nominal)
    return found
