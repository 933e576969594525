"""Fit SysIdentPy and jax-sysid to the folds in a file; runs in their own environment, without pamid.

Usage: ``python fit_peers.py FOLDS.npz OUT.npz``. ``FOLDS.npz`` holds ``folds``, ``dynamic`` and for each fold k the
arrays ``X{k}``, ``y{k}``, ``run{k}`` of the training and ``Xt{k}``, ``yt{k}``, ``runt{k}`` of the test; of ``yt`` the
first value of each run is read, no other. ``OUT.npz`` gets ``<peer>{k}``, the predictions, and ``<peer>_seconds``, of
one core, a fit.
"""

from __future__ import annotations

import logging
import os
import sys
import time
import warnings
from itertools import pairwise

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_thunk_runtime=false --xla_cpu_multi_thread_eigen=false")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import numpy as np

LEAD = 50
"""Rows that lead into a run: its first row, held."""


def pieces(run: np.ndarray) -> list[slice]:
    edges = [0, *(np.flatnonzero(np.diff(run)) + 1).tolist(), len(run)]
    return [slice(a, b) for a, b in pairwise(edges)]


def ahead(X: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Shift the inputs by one row, since SysIdentPy sees those of the row before at the latest."""
    return np.concatenate([np.concatenate([X[s][1:], X[s][-1:]]) for s in pieces(run)])


def sysidentpy(dynamic: bool, degree: int, X, y, run, Xt, yt, runt):
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    lags = [list(range(1, 3 if dynamic else 2)) for _ in range(X.shape[1])]
    model = FROLS(
        n_info_values=30,
        order_selection=True,
        info_criteria="bic",
        ylag=2,
        xlag=lags,
        model_type="NARMAX" if dynamic else "NFIR",
        basis_function=Polynomial(degree=degree),
        estimator=LeastSquares(),
    )
    model.fit(X=ahead(X, run), y=y[:, None])
    out = np.empty(len(yt))
    for s in pieces(runt):
        u = ahead(Xt, runt)[s]
        lead = max(model.max_lag, 2)
        u = np.concatenate([np.repeat(u[:1], lead, axis=0), u])
        start = np.full((lead, 1), yt[s.start])
        z = np.asarray(model.predict(X=u, y=np.concatenate([start, np.zeros((len(u) - lead, 1))])[: len(u)])).ravel()
        out[s] = z[lead:]
    return out


def network(outputs: int, *hidden: int):
    """Return a class of feed-forward networks, as jax-sysid wants it."""
    from flax import linen

    class Network(linen.Module):
        @linen.compact
        def __call__(self, x):
            for units in hidden:
                x = linen.tanh(linen.Dense(features=units)(x))
            return linen.Dense(features=outputs)(x)

    return Network


def jax_sysid(dynamic: bool, X, y, run, Xt, yt, runt):
    import jax
    from jax_sysid.models import FNN, RNN

    jax.config.update("jax_enable_x64", True)
    if not dynamic:
        model = FNN(1, X.shape[1], FY=network(1, 64, 64))
        model.loss(rho_th=1e-6)
        model.optimization(adam_epochs=500, lbfgs_epochs=1000, iprint=-1)
        model.fit(y[:, None], X)
        return np.asarray(model.predict(Xt)).ravel()
    model = RNN(4, 1, X.shape[1], FX=network(4, 16), FY=network(1, 16), x_scaling=0.1)
    model.loss(rho_x0=1e-4, rho_th=1e-6, train_x0=False)
    model.optimization(adam_epochs=500, lbfgs_epochs=1000, iprint=-1)

    def led(Z, s):
        return np.concatenate([np.repeat(Z[s][:1], LEAD, axis=0), Z[s]])

    rows = pieces(run)
    model.fit([led(y[:, None], s) for s in rows], [led(X, s) for s in rows])
    out = np.empty(len(yt))
    for s in pieces(runt):
        z, _ = model.predict(np.zeros(4), led(Xt, s))
        out[s] = np.asarray(z).ravel()[LEAD:]
    return out


def main(source: str, target: str) -> None:
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    data = np.load(source, allow_pickle=False)
    dynamic = bool(data["dynamic"])
    peers = {
        "SysIdentPy, degree 2": lambda *a: sysidentpy(dynamic, 2, *a),
        "SysIdentPy, degree 3": lambda *a: sysidentpy(dynamic, 3, *a),
        "jax-sysid": lambda *a: jax_sysid(dynamic, *a),
    }
    out = {}
    for name, peer in peers.items():
        seconds = 0.0
        try:
            for k in range(int(data["folds"])):
                X, y, run, Xt, yt, runt = (data[f"{n}{k}"] for n in ("X", "y", "run", "Xt", "yt", "runt"))
                mean, scale, middle, size = X.mean(axis=0), X.std(axis=0), y.mean(), y.std()
                scale = np.where(scale > 0, scale, 1.0)
                started = time.process_time()
                z = peer((X - mean) / scale, (y - middle) / size, run, (Xt - mean) / scale, (yt - middle) / size, runt)
                seconds += time.process_time() - started
                out[f"{name}{k}"] = z * size + middle
            out[f"{name}_seconds"] = np.array(seconds / int(data["folds"]))
        except Exception as error:  # one peer that fails is a line, not the end
            out[f"{name}_error"] = np.array(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}")
        print(f"{name}: {out.get(f'{name}_error', 'fitted')}", flush=True)
    np.savez(target, **out)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
