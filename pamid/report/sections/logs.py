"""The logs one by one, where there are several."""

from typing import Any, ClassVar

from ..quantities import amount_within, effect, parameter, span
from ..several import changed
from .base import Section


class LogsSection(Section):
    """What changed between logs, and the causes' parameters in each."""

    name: ClassVar[str] = "logs"
    title: ClassVar[str] = "Log by log"
    rank: ClassVar[int] = 26

    def shown(self) -> bool:
        """Whether there are several logs."""
        return len(self.diagnosis.logs) > 1

    def content(self) -> dict[str, Any]:
        """Return the changes and a row for each parameter of a cause in each log."""
        rows = []
        for log in self.diagnosis.logs:
            for name, parameters in log.parameters.items():
                for word, p in parameters.items():
                    rows.append(
                        {
                            "log": log.log,
                            "day": log.day,
                            "effect": effect(name),
                            "parameter": parameter(word),
                            "value": amount_within(p.value, *p.ci90, p.unit),
                            "ci": span(*p.ci90, p.unit),
                        }
                    )
        return {"changes": [changed(c) for c in self.diagnosis.changes], "rows": rows}
