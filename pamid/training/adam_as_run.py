"""Algorithms 1 and 2 of the study as their authors' public notebooks ran them, where that differs from the print."""

from dataclasses import KW_ONLY
from typing import ClassVar

from ..explained import parameters
from .adam import Adam
from .units import TrainingUnits


@parameters
class AdamAsRun(Adam):
    """Train as the authors' notebooks do: ``trainer="adam_as_run"``, beside ``"adam"``, which follows the paper.

    The decay counts once, ε stands beside the root, a batch has 1,024 samples. The network reads 10 ε, 10 dε/dt, bar
    and bar/s and gives 10⁻¹⁰ m³; losses are in (NL/min)². Adapters run 1,000 epochs in batches of 128. What differs in
    the data (every tenth row from scratch, every thousandth to adapt, rows split 80 : 20 at random) is left to the
    data, R = 263.8 to ``gas_constant``.

    Parameters
    ----------
    max_iter : int, default=10000
        Epochs asked for; the logs that are public end at 3,177 and at 403.

    Examples
    --------
    >>> from pamid.training import AdamAsRun
    >>> trainer = AdamAsRun()
    >>> trainer.decay, trainer.epsilon_inside, trainer.batch_size
    ('once', False, 1024)
    """

    units: ClassVar[TrainingUnits | None] = TrainingUnits(
        inputs=(0.1, 0.1, 1e5, 1e5), targets={"flow": 2.1542e-5}, volume=1e-10
    )
    adapting: ClassVar[dict[str, int]] = {"batch_size": 128, "max_iter": 1_000}

    _: KW_ONLY
    batch_size: int = 1024
    decay: str = "once"
    epsilon_inside: bool = False
