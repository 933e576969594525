"""Progress, early stop and interruption of a fit, through ``sklearn.callback``.

That interface is experimental in scikit-learn 1.9, so this module alone knows it. An iterative estimator goes through
``for epoch in progress`` within ``with fit_progress(self, X=X, y=y, max_epochs=...) as progress`` and closes each epoch
by ``progress.report(loss, attributes=...)``; a trainer that owns the loop calls ``if progress.report(loss): stop``.

- ``attributes`` returns every fitted attribute that predict needs and that is not yet set; it is called only where a
  callback wants a fitted estimator. X and y are as the user gave them.
- The loop ends where a callback asks to stop (``progress.stopped``), or at Ctrl-C once one epoch is complete
  (``progress.interrupted``, with `InterruptedFitWarning`), so that the code after it keeps the best so far.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Self

from pamid.errors import InterruptedFitWarning
from pamid.fitting.marquardt import Marquardt

try:
    from sklearn.callback import CallbackSupportMixin as _CallbackSupportMixin
    from sklearn.callback._callback_support import callback_management_context as _management
except ImportError:  # the experimental interface moved: fits go on, callbacks are not offered
    _CallbackSupportMixin, _management = object, None


if TYPE_CHECKING:

    class ProgressMixin:
        """Gives an estimator ``set_callbacks``, of scikit-learn's base without types."""

        def set_callbacks(self, *callbacks: Any) -> Self: ...
else:

    class ProgressMixin(_CallbackSupportMixin):
        """Gives an estimator ``set_callbacks``; goes left of the other bases."""


class FitProgress:
    """The epochs of one fit, as its callbacks see them. Made by `fit_progress`."""

    def __init__(self, estimator: Any, X: Any, y: Any, max_epochs: int, context: Any = None) -> None:
        self.n_epochs = 0
        self.losses: list[float] = []
        self.stopped = False
        self.interrupted = False
        self._estimator, self._X, self._y = estimator, X, y
        self._max_epochs = max_epochs
        self._context = context
        self._epoch: Any = None

    def __iter__(self) -> Iterator[int]:
        """Count the epochs until the last one or until a callback asks to stop."""
        while self.n_epochs < self._max_epochs and not self.stopped:
            before = self.n_epochs
            self._begin()
            yield before
            if self.n_epochs == before:
                raise RuntimeError("progress.report was not called in this epoch")

    def report(
        self,
        loss: float,
        *,
        validation_loss: float | None = None,
        attributes: Callable[[], dict[str, Any]] | None = None,
    ) -> bool:
        """Close an epoch: note its loss, tell the callbacks, and return whether one of them asks to stop."""
        self._begin()
        self.n_epochs += 1
        self.losses.append(float(loss))
        if self._epoch is not None:
            self._epoch.loss, self._epoch.validation_loss = self.losses[-1], validation_loss
            epoch, self._epoch = self._epoch, None
            self.stopped |= bool(
                epoch.call_on_fit_task_end(
                    estimator=self._estimator, X=self._X, y=self._y, reconstruction_attributes=attributes
                )
            )
        return self.stopped

    def _begin(self) -> None:
        if self._context is not None and self._epoch is None and self.n_epochs < self._max_epochs:
            self._epoch = self._context.subcontext(task_name="epoch")
            self._epoch.call_on_fit_task_begin(estimator=self._estimator, X=self._X, y=self._y)


@contextmanager
def fit_progress(estimator: Any, *, X: Any, y: Any, max_epochs: int, stacklevel: int = 5) -> Iterator[FitProgress]:
    """Follow the epochs of a fit: callbacks, early stop, and an interruption that keeps what was reached."""
    callbacks = _management is not None and bool(getattr(estimator, "_skl_callbacks", None))
    with _management(estimator) if callbacks else nullcontext():
        context = estimator._init_callback_context(max_subtasks=max_epochs) if callbacks else None
        if context is not None:
            context.call_on_fit_task_begin(estimator=estimator, X=X, y=y)
        progress = FitProgress(estimator, X, y, max_epochs, context)
        try:
            yield progress
        except KeyboardInterrupt as stop:
            if progress.n_epochs == 0 or type(stop) is not KeyboardInterrupt:  # the latter where the process is ended
                raise
            progress.interrupted = True
            warnings.warn(
                f"The fit of {type(estimator).__name__} was interrupted after {progress.n_epochs} of at most "
                f"{max_epochs} epochs. The best model so far is kept.",
                InterruptedFitWarning,
                stacklevel=stacklevel,
            )
        if context is not None:
            context.call_on_fit_task_end(estimator=estimator, X=X, y=y)


def descend(
    estimator: Any,
    steps: Marquardt,
    data: tuple[Any, Any],
    *,
    per: float,
    patience: int,
    attributes: Callable[[], dict[str, Any]],
    stacklevel: int = 6,
) -> None:
    """Take steps until `patience` in a row gain less than a share `tol` of the loss; set the estimator's loss curve."""
    with fit_progress(
        estimator, X=data[0], y=data[1], max_epochs=int(estimator.max_iter), stacklevel=stacklevel
    ) as progress:
        slow = 0
        for _ in progress:
            before = steps.loss
            moved = steps.step()
            progress.report(steps.loss / per, attributes=attributes)
            slow = slow + 1 if steps.loss > before * (1.0 - float(estimator.tol)) else 0
            if not moved or slow >= patience:
                break
    estimator.loss_curve_ = progress.losses
    estimator.n_iter_ = max(progress.n_epochs, 1)
