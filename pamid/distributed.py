"""Work on a dask cluster that survives its workers: joblib's dask backend, with data that can be sent again.

joblib's own backend scatters arguments to a worker. Scattered data has no recipe: where its worker dies, every task
that reads it is cancelled, and the search with it. Here the same data is the result of a task, which the scheduler
runs again on another worker.
"""

import contextlib
import functools
import logging
import uuid
from collections.abc import Iterator
from typing import Any

from .errors import MissingDependencyError, ParameterError

LARGEST_WARNING = "10 GiB"
"""Size of a task's data above which dask may warn; below, sending it once is what is meant."""


@contextlib.contextmanager
def on_dask(cluster: Any = None, *, n_workers: int = 2) -> Iterator[Any]:
    """Run parallel code in the block on a dask cluster, to the same result even if workers are killed.

    Searches of scikit-learn, `pamid.compare.compare` and everything else that uses joblib is spread over the workers,
    one task a core. A task whose worker dies runs again on another one, up to dask's ``allowed-failures`` times (3).
    What runs in parallel inside a task runs in that task alone.
    """
    try:
        import distributed
    except ImportError:
        raise MissingDependencyError(
            "dask is not installed.", "dask and distributed", 'Install them: pip install "pamid[distributed]".'
        ) from None
    import joblib

    with contextlib.ExitStack() as stack:
        if isinstance(cluster, distributed.Client):
            client = cluster
        else:
            if cluster is None:
                if n_workers < 1:
                    raise ParameterError(f"n_workers is {n_workers}.", "at least 1", "Correct it.")
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=n_workers,
                        threads_per_worker=1,
                        processes=True,
                        dashboard_address=None,
                        memory_limit=0,
                        silence_logs=logging.CRITICAL,
                    )
                )
            try:
                client = stack.enter_context(distributed.Client(cluster, set_as_default=False))
            except (OSError, ValueError, TypeError) as error:
                raise ParameterError(
                    f"There is no dask cluster at {cluster!r}: {str(error)[:120]}.",
                    "the address of a scheduler that runs",
                    "Start one with 'dask scheduler' and workers with 'dask worker ADDRESS', or correct the address.",
                ) from None
        stack.enter_context(_large_graphs())
        joblib.register_parallel_backend("pamid-dask", functools.partial(_backend(), client=client))
        stack.enter_context(joblib.parallel_config("pamid-dask", n_jobs=-1))
        yield client


@contextlib.contextmanager
def _large_graphs() -> Iterator[None]:
    import dask

    with dask.config.set({"distributed.admin.large-graph-warning-threshold": LARGEST_WARNING}):
        yield


def _same(value: Any) -> Any:
    return value


class _Sender:
    """A client whose scattered data is the result of a task, so that it can be made again."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)

    def scatter(self, value: Any, *, asynchronous: bool = False, **_: Any) -> Any:
        """Return the future of a value, awaitable where asked for."""

        async def later() -> Any:
            return self._client.submit(_same, value, key=f"pamid-data-{uuid.uuid4().hex}", pure=False)

        return later()


@functools.cache
def _backend() -> type:
    """Return the backend; it exists once dask does."""
    from joblib._dask import Batch, DaskDistributedBackend

    class AloneBatch(Batch):
        """Tasks that run one after the other, without spreading what is parallel inside them."""

        def __call__(self, tasks: Any = None) -> list[Any]:
            from joblib import parallel_config

            with parallel_config(backend="sequential"):
                return [func(*args, **kwargs) for func, args, kwargs in tasks]

    class LastingDask(DaskDistributedBackend):
        """joblib's backend with data that outlives a worker."""

        def __init__(self, client: Any = None, **settings: Any) -> None:
            super().__init__(client=_Sender(client), **settings)

        async def _to_func_args(self, func: Any) -> tuple[Any, list[Any]]:
            batch, tasks = await super()._to_func_args(func)
            batch.__class__ = AloneBatch
            return batch, tasks

    return LastingDask
