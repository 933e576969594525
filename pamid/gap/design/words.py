"""A plan in words: what it is expected to tell, and what each outcome would mean."""

from __future__ import annotations

import math

from .plan import TELLS, Plan


def summary(plan: Plan) -> str:
    """Return the plan in one or two sentences."""
    if plan.purpose == "none":
        return "Nothing is undecided, and no cause is named whose parameters a run could determine."
    said = [named(n) for n in plan.explanations]
    if plan.purpose == "unseen":
        listed = ", ".join(said[1:])
        now = "The next recording is to show them." if plan.tells else "Nor would any run within the limits show them."
        return f"The logs need no effect, but would hardly have shown these at their typical size: {listed}. {now}"
    if plan.purpose == "parameters":
        if not plan.tells:
            return f"Only {said[0]} is left, and no run within the limits would narrow its parameters by much."
        return f"Only {said[0]} is left: the next recording determines its parameters."
    undecided = f"Undecided: {', '.join(f'{s} ({b:.0%})' for s, b in zip(said, plan.beliefs, strict=True))}."
    if not plan.tells:
        longer = "A longer one would not, either."
        if math.isfinite(plan.needed):
            like = f" ({plan.closest[0].words.rpartition(', ')[0]})" if len(plan.closest) == 1 else ""
            longer = f"One of about {plan.needed:.0f} s would{like}."
        return (
            f"{undecided} No run of {plan.limits.seconds:g} s within the limits tells the likeliest one from the "
            f"others. {longer} Widen a limit (--angle, --pressure, --rise), log another signal, or take them as one."
        )
    hardest = min(e.nats for e in plan.expected)
    clear = f"The pair that is hardest to distinguish is expected to differ by {hardest:.3g} nats"
    return f"{undecided} {clear}{'' if not plan.alike else ', which is too little'}; 3 are odds of twenty."


def outcomes(plan: Plan) -> list[str]:
    """Return what each outcome would mean, and what would stay open."""
    found = []
    if plan.purpose == "unseen":
        for e in plan.expected if plan.runs else []:
            clear = f"the simulator without it falls behind by {e.nats:.3g} nats, most in the {e.equation} equation"
            said = clear if e.nats >= TELLS else "it would not show in this run, either"
            found.append(f"If it has {named(e.truth)}, {said}.")
        return found
    for truth in plan.explanations:
        mine = [e for e in plan.expected if e.truth == truth]
        if not plan.runs or not mine:
            continue
        closest = min(mine, key=lambda e: e.nats)
        far = max(mine, key=lambda e: e.size)
        found.append(
            f"If it is {named(truth)}, {named(closest.rival)} falls behind it by {closest.nats:.3g} nats "
            f"({closest.low:.3g} to {closest.high:.3g}), and the {far.equation} error that {named(far.rival)} leaves "
            f"is {far.size:.2g} times the noise."
        )
    for one, other in plan.alike:
        found.append(
            f"{_capital(named(one))} and {named(other)} would stay one class: no run within the limits tells them "
            "apart."
        )
    if plan.runs and plan.expected:
        found.append(
            "If all of them leave more than noise, the cause is none of these: diagnose with the whole library."
        )
    return found


def named(names: tuple[str, ...]) -> str:
    """Return a set of effects as words."""
    return " and ".join(n.replace("_", " ") for n in names) or "no effect"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
