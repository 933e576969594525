"""The volume network and its trainers (needs torch; loaded when a network is trained)."""

import re

from .._discovery import subclasses
from .._lazy import renamed
from ..errors import UnknownOptionError
from .adam import Adam
from .adam_as_run import AdamAsRun
from .levenberg_marquardt import LevenbergMarquardt
from .problem import TrainingProblem
from .result import Status, TrainingResult
from .trainer import Trainer

TRAINERS: dict[str, type[Trainer]] = {
    re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower(): cls for cls in subclasses(__name__, Trainer)
}
"""Every trainer that a module of this package defines, by its name in small letters."""


def trainer_named(trainer: str | Trainer) -> Trainer:
    """Return a trainer by its name in `TRAINERS`, with default parameters, or the trainer itself."""
    if isinstance(trainer, Trainer):
        return trainer
    if not isinstance(trainer, str) or trainer not in TRAINERS:
        raise UnknownOptionError(
            f"trainer={trainer!r} is not known.",
            f"one of {', '.join(TRAINERS)}, or a Trainer",
            "Choose one of these names.",
        )
    return TRAINERS[trainer]()


__all__ = [
    "TRAINERS",
    "Adam",
    "AdamAsRun",
    "LevenbergMarquardt",
    "Status",
    "Trainer",
    "TrainingProblem",
    "TrainingResult",
]

__getattr__ = renamed(__name__, {"Problem": "TrainingProblem"})
