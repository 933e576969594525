"""What to record next."""

from typing import Any, ClassVar

from ..sentences import experiment, experiment_option, experiment_reason
from .base import Section


class NextExperimentSection(Section):
    """The run that would distinguish the two likeliest explanations."""

    name: ClassVar[str] = "next"
    title: ClassVar[str] = "What to record next"
    rank: ClassVar[int] = 80

    def shown(self) -> bool:
        """Whether a run is proposed."""
        return self.diagnosis.next_run is not None

    def content(self) -> dict[str, Any]:
        """Return the proposal."""
        proposed = self.diagnosis.next_run
        assert proposed is not None
        return {
            "words": experiment(proposed),
            "reason": experiment_reason(proposed),
            "option": experiment_option(proposed),
        }
