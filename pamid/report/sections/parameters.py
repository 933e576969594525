"""The parameters of the causes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from ..quantities import amount, effect, parameter, percent, share_span, span
from .base import Section

if TYPE_CHECKING:
    from ...gap.diagnosis.findings import ParameterEstimate


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
        from ...bench.parameters import UNITS

        d = self.diagnosis
        causes = [
            {
                "name": effect(c.effects[0]),
                "others": [effect(e) for e in c.effects[1:]],
                "equation": c.equation,
                "share": percent(c.share),
                "ci": share_span(*c.share_ci90),
                "rows": _rows(c.parameters),
                "instead": [
                    {"name": effect(e), "rows": _rows(p)} for e, p in zip(c.effects[1:], c.others, strict=False)
                ],
            }
            for c in d.added
        ]
        refitted = []
        if d.corrected is not None and d.nominal is not None:
            for name, tolerance in d.corrected.tolerance.items():
                value, before = (amount(p.get(name), UNITS.get(name, ""), 4) for p in (d.corrected, d.nominal))
                row = {"name": name, "value": value, "before": before, "tolerance": f"± {100 * tolerance:g} %"}
                refitted.append(row)
        return {"causes": causes, "refitted": refitted}


def _rows(parameters: Mapping[str, ParameterEstimate]) -> list[dict[str, str]]:
    return [
        {
            "name": parameter(name),
            "value": amount(p.value, p.unit),
            "ci": span(*p.ci90, p.unit) + (", at its physical limit" if p.at_bound else ""),
        }
        for name, p in parameters.items()
    ]
