"""What a diagnosis of several logs says beyond that of one, in words."""

import math

from ..gap.several.result import Change
from .quantities import amount, capital, effect, parameter


def changed(change: Change) -> str:
    """Return how a cause changed between logs, as a sentence."""
    name = f"{effect(change.effect)} at {change.where}" if change.where else effect(change.effect)
    name = capital(name)
    what = parameter(change.parameter)
    values = [amount(v, change.unit) for v in (change.before, change.after) if math.isfinite(v)]
    since = change.log if change.log.startswith("from ") else f"with {change.log}"
    until = since.replace("with ", "from ", 1)
    said = {
        "appears": f"{name} appears {since}: {what} {values[-1] if values else 'unknown'}",
        "goes": f"{name} is gone {until} on: {what} {values[0] if values else 'unknown'} before",
        "grows": f"{name} grows {since}: {what} from {' to '.join(values)}",
        "shrinks": f"{name} shrinks {since}: {what} from {' to '.join(values)}",
    }.get(change.how, f"{name} differs from {change.log} on")
    return f"{said} (log-likelihood higher by {change.evidence:.0f} than if it stayed the same)."
