"""The parameters of the causes."""

from collections.abc import Mapping
from typing import Any, ClassVar

from ...bench.parameters import UNITS
from ...gap.diagnosis.findings import Cause, ParameterEstimate
from ..causes import named, shown_unit
from ..quantities import amount, amount_within, parameter, percent_within, places, share_span, span
from .base import Section


class ParametersSection(Section):
    """What was identified, with intervals, and what the simulator was refitted to."""

    name: ClassVar[str] = "parameters"
    title: ClassVar[str] = "What was identified"
    rank: ClassVar[int] = 70

    def heading(self) -> str:
        """Return the heading under this diagnosis."""
        return self.title if self.diagnosis.added else "Parameters of the simulator"

    def shown(self) -> bool:
        """Whether there is a cause or a tolerance."""
        corrected = self.diagnosis.corrected
        return bool(self.diagnosis.added or (corrected is not None and corrected.tolerance))

    def content(self) -> dict[str, Any]:
        """Return the tables."""
        d = self.diagnosis
        causes = [
            {
                "name": names[0],
                "others": names[1:],
                "place": self.words.in_equation(c.equation),
                "share": percent_within(c.share, *c.share_ci90),
                "ci": share_span(*c.share_ci90),
                "rows": _rows(c, c.effects[0], c.parameters),
                "instead": [
                    {"name": named(e, port), "rows": _rows(c, e, p)}
                    for e, port, p in zip(c.effects[1:], places(c)[1:], c.others, strict=False)
                ],
            }
            for c, names in ((c, [named(*one) for one in zip(c.effects, places(c), strict=True)]) for c in d.added)
        ]
        refitted = []
        if d.corrected is not None and d.nominal is not None:
            for name, tolerance in d.corrected.tolerance.items():
                value, before = (amount(p.get(name), UNITS.get(name, ""), 4) for p in (d.corrected, d.nominal))
                end = ", at its end" if abs(d.deviations.get(name, 0.0)) >= 1.0 else ""
                row = {"name": name, "value": value, "before": before, "tolerance": f"± {100 * tolerance:g} %{end}"}
                refitted.append(row)
        return {"causes": causes, "refitted": refitted}


def _rows(cause: Cause, effect: str, parameters: Mapping[str, ParameterEstimate]) -> list[dict[str, str]]:
    port = "".join(places(cause)[:1])
    return [
        {
            "name": parameter(name),
            "value": amount_within(p.value, *p.ci90, unit) + (f" ({p.physical})" if p.physical else ""),
            "ci": span(*p.ci90, unit) + (", at its physical limit" if p.at_bound else ""),
        }
        for name, p, unit in ((name, p, shown_unit(effect, name, p.unit, port)) for name, p in parameters.items())
    ]
