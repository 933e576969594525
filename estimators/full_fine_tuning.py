"""Full fine-tuning: all parameters of the source's network are trained on the target's data."""

from __future__ import annotations

from typing import Any

from ._adaptation import AdaptedModel
from ._base import Signals
from ._tiny_source import tiny_source


class FullFineTuning(AdaptedModel):
    r"""Adapt a hybrid model by training all parameters of its network.

    It starts at the source's own volume, so a target of another size is far away at first; `QAdapter` starts at its
    size. The prior is the source: the penalty is :math:`\lambda\lVert\theta-\theta_\mathrm{source}\rVert^2`.

    Parameters
    ----------
    source : estimator
        The fitted hybrid model of the muscle whose data are plenty, best in a `sklearn.frozen.FrozenEstimator`, so that
        clones keep its fit. It stays untouched.
    rest_length, rest_diameter : float, optional
        L₀ and D₀ of the target muscle, m; those of the source by default.
    trainer : {"levenberg_marquardt", "adam"} or Trainer, default="levenberg_marquardt"
        ``"adam"`` is the published algorithm with its hyperparameters.
    max_iter, batch_size : int, optional
        Override those of the trainer.
    weight_decay : float or "auto", default="auto"
        Strength of the pull toward the source, relative to the mean squared residual in units of the variance of the
        target. ``"auto"`` sets it by cross-validation over whole runs, at the cost of one step;
        where it would raise the held-out error, the network stays as it is. For Adam it is the published decay.
    validation_fraction : float or "auto", default=0.0
        Share of whole runs held out for early stopping.
    blend : {"auto"} or bool, default="auto"
        Whether held-out samples decide, once, the share of a fresh fit of the same samples in the predictions
        (`pamid.adapters.source_process`), so that they are not worse than without a source. ``"auto"`` leaves the
        published algorithm as published.
    warm_start : bool, default=False
        Whether another ``fit`` continues the present adaptation.
    signals : dict, optional
        Column of X for each of the signals ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute) and ``dP`` (Pa/s).
    device : str, default="cpu"
        Where to train, for instance ``"cuda"``.
    random_state : int, RandomState or None, default=None
        Seed of the draws.

    Attributes
    ----------
    model_ : StaticPIHM, ThermodynamicPIHM or JointPIHM
        The model of the target muscle, of the source's class.
    n_parameters_ : int
        Number of adapted parameters.
    weight_decay_ : float
        Strength of the pull; infinite where the network stays as it is.
    blend_ : ndarray, shape (n_targets,)
        Share of the fresh fit in the predictions, 0 where the adapted model stays alone.
    source_kept_ : ndarray, shape (n_targets,)
        Share of the source in the predictions: of the adapted model, and of the source within the fresh fit.
    held_out_errors_ : list of dict
        Root mean square errors on held-out samples, in the target's unit: ``adapted``, ``fresh`` (without the source)
        and ``both`` (a fresh fit that reads the source's prediction).
    n_iter_, loss_curve_, validation_curve_, status_
        As in `StaticPIHM`.

    See Also
    --------
    QAdapter : Starts at the target's size by a factor on the volume.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: FFT of Table 2.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import FullFineTuning, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = FullFineTuning(FrozenEstimator(A), weight_decay=1e-6, random_state=0).fit(X[::10], 1.2 * F[::10])
    >>> bool(B.score(X, 1.2 * F) > 0.99)
    True
    """

    method = "full"

    def __init__(
        self,
        source: Any,
        *,
        rest_length: float | None = None,
        rest_diameter: float | None = None,
        trainer: Any = "levenberg_marquardt",
        max_iter: int | None = None,
        batch_size: int | None = None,
        weight_decay: float | str | None = "auto",
        validation_fraction: float | str = 0.0,
        blend: bool | str = "auto",
        warm_start: bool = False,
        signals: Signals | None = None,
        device: str = "cpu",
        random_state: Any = None,
    ) -> None:
        self.source = source
        self.rest_length = rest_length
        self.rest_diameter = rest_diameter
        self.trainer = trainer
        self.max_iter = max_iter
        self.batch_size = batch_size
        self.weight_decay = weight_decay
        self.validation_fraction = validation_fraction
        self.blend = blend
        self.warm_start = warm_start
        self.signals = signals
        self.device = device
        self.random_state = random_state

    def _adapter(self) -> Any:
        from pamid.adapters.fine_tuning import FineTuning

        return FineTuning()

    @classmethod
    def _checked_instances(cls) -> list[FullFineTuning]:
        one = dict.fromkeys(("eps", "deps", "P", "dP"), 0)
        return [cls(tiny_source(), signals=one, max_iter=5)]
