"""Algorithms 1 and 2 of the study as their authors' public notebooks ran them, where that differs from the print."""

from __future__ import annotations

from typing import ClassVar

from .adam import Adam
from .units import TrainingUnits


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
    learning_rate, weight_decay : float
        As in `Adam`.
    batch_size : int
        As in `Adam`.
    beta1, beta2, epsilon : float
        As in `Adam`.
    decay : str
        As in `Adam`.
    epsilon_inside : bool
        As in `Adam`.
    keep : str
        As in `Adam`.
    patience : int
        As in `Adam`.
    checkpoint : str or None
        As in `Adam`.

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

    def __init__(
        self,
        max_iter: int = 10_000,
        *,
        learning_rate: float = 1e-4,
        weight_decay: float = 1e-5,
        batch_size: int = 1024,
        beta1: float = 0.9,
        beta2: float = 0.999,
        epsilon: float = 1e-8,
        decay: str = "once",
        epsilon_inside: bool = False,
        keep: str = "last",
        patience: int = 500,
        checkpoint: str | None = None,
    ) -> None:
        super().__init__(
            max_iter,
            learning_rate=learning_rate,
            weight_decay=weight_decay,
            batch_size=batch_size,
            beta1=beta1,
            beta2=beta2,
            epsilon=epsilon,
            decay=decay,
            epsilon_inside=epsilon_inside,
            keep=keep,
            patience=patience,
            checkpoint=checkpoint,
        )
