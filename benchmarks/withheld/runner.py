"""Run the check: batches on several processes, one file a case, so that a stopped check goes on where it was."""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd

from .generator import Case, generate
from .metrics import Answer, Record, Truth
from .oracle import oracle, oracle_each
from .suites import Batch

METHODS = ("ours", "ranking", "sindy", "black box")
Diagnose = Callable[..., Any]


def write_json(path: Path, content: Any) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump(content, file, default=_plain)
    Path(name).replace(path)


def _plain(x: Any) -> Any:
    if isinstance(x, np.generic):
        return x.item()
    if isinstance(x, np.ndarray):
        return x.tolist()
    raise TypeError(f"cannot write {type(x).__name__}")


def failed(truth: Truth, seconds: float) -> Answer:
    """Return the answer that counts for a diagnosis that raised: wrong, whatever is true."""
    return Answer(gap=not truth.effects, verdict="error", confidence={"error": 1.0}, seconds=seconds)


def examine(case: Case, diagnose: Diagnose | None, rivals: bool) -> dict[str, Any]:
    """Diagnose one case by all methods.

    Parameters
    ----------
    case : Case
        The case.
    diagnose : callable or None
        ``diagnose(log, params, effects, seed)``; None leaves ours out.
    rivals : bool
        Whether the rivals run, too.

    Returns
    -------
    dict
        What is written for the case.
    """
    from pamid.effects.registry import chosen_effects

    from . import judge, novelty

    params = judge.simulator(case.sim_toml)
    true = judge.truth(case.key)
    names = [n for n in chosen_effects("all", "bench") if n not in case.spec.left_out]
    out: dict[str, Any] = {"name": case.spec.name, "key": case.key, "answers": {}}
    if case.spec.targets:
        out["signature"] = novelty.signature(case.log, params)
    if diagnose is not None:
        out["oracle"] = oracle(case, params)
        began = time.perf_counter()
        try:
            d = diagnose(case.log, params, names, case.spec.index)
            seconds = time.perf_counter() - began
            said = d.as_dict()
            out["diagnosis"], out["out_of_form"] = said, judge.checked(said)
            out["answers"]["ours"] = asdict(_ours(case, params, true, d, said, seconds))
            if case.spec.suite == "several":
                out["oracle_each"] = oracle_each(case, params)
                out["left"] = judge.left_share(case, judge.refitted(case, params), d.corrected)
        except Exception as error:
            out["error"] = f"{type(error).__name__}: {error}"
            out["traceback"] = traceback.format_exc()
            out["answers"]["ours"] = asdict(failed(true, time.perf_counter() - began))
    if rivals:
        out |= _rivals(case, params, names, out["answers"])
    return out


def _ours(case: Case, params: Any, true: Truth, d: Any, said: Mapping[str, Any], seconds: float) -> Answer:
    from pamid.effects import all_effects

    from . import judge

    region = realised = None
    if true.equations and said["gap"]:
        main = true.equations[0]
        region = judge.regions(case, said["where"]["regions"], main, judge.state_table(case.log, params))
        if said.get("causes"):
            realised = judge.closed_share(case.future_clean, judge.refitted(case, params), d.corrected, main)
    families = {n: c.family for n, c in all_effects().items()}
    return judge.answer(said, true, families, region, realised, judge.amplitude_covered(said, case.key), seconds)


def _rivals(case: Case, params: Any, names: Sequence[str], answers: dict[str, Any]) -> dict[str, Any]:
    from . import rivals

    shared = rivals.HeldOut(case.log, params)
    f = rivals.features(case.log, params, shared.base)
    ranked, closed = rivals.ranking(shared, names)
    answers["ranking"] = asdict(ranked)
    answers["sindy"] = asdict(rivals.sindy(shared, f))
    answers["black box"] = asdict(rivals.black_box(shared, f))
    return {"closed_by": closed}


def ours(log: pd.DataFrame, params: Any, effects: Sequence[str], seed: int) -> Any:
    """Diagnose with pamid."""
    from pamid.gap import diagnose

    return diagnose(log, params, effects=list(effects), seed=seed)


def named_always(log: pd.DataFrame, params: Any, effects: Sequence[str], seed: int) -> Any:
    """Diagnose with pamid, names being said however little is to be trusted in them: what trust is measured on."""
    with mock.patch("pamid.gap.diagnosis.open_set.TRUSTED", -1.0):
        return ours(log, params, effects, seed)


def _leave_with(parent: int) -> None:
    """Start a thread that ends this process once its parent is gone, which a waiting worker would never learn."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def run_batch(
    batch: Batch, folder: Path, rivals: bool, only_rivals: bool, keep: Path | None, diagnose: Diagnose | None = None
) -> int:
    """Generate a batch and examine those of its cases that have no file yet; return how many."""
    missing = [s.name for s in batch.specs if not (folder / f"{s.name}.json").is_file()]
    if not missing and keep is None:
        return 0
    for case in generate(batch.specs, batch.layout):
        if keep is not None:
            save(case, keep)
        if case.spec.name in missing:
            result = examine(case, None if only_rivals else diagnose or ours, rivals)
            write_json(folder / f"{case.spec.name}.json", result)
    return len(missing)


def save(case: Case, folder: Path) -> None:
    """Write a case as a bench would deliver it, and its key apart."""
    data = folder / "cases" / case.spec.name
    data.mkdir(parents=True, exist_ok=True)
    case.log.to_parquet(data / "data.parquet")
    case.future.to_parquet(data / "future.parquet")
    (data / "sim.toml").write_text(case.sim_toml, encoding="utf-8")
    write_json(folder / "keys" / f"{case.spec.name}.json", case.key)


def run(
    listed: Sequence[Batch],
    folder: Path,
    jobs: int,
    rivals: bool,
    only_rivals: bool = False,
    keep: Path | None = None,
    diagnose: Diagnose | None = None,
) -> None:
    """Run all batches, with progress on standard error.

    Parameters
    ----------
    listed : sequence of Batch
        The batches.
    folder : Path
        Where the files of the cases lie.
    jobs : int
        Processes.
    rivals, only_rivals : bool
        Whether the rivals run, and whether they alone do.
    keep : Path, optional
        Where the cases themselves are written, too.
    diagnose : callable, optional
        What diagnoses, `ours` by default.
    """
    folder.mkdir(parents=True, exist_ok=True)
    total = sum(len(b.specs) for b in listed)
    wanted = {s.name for b in listed for s in b.specs}
    at_start = _done(folder, wanted)
    began = time.perf_counter()

    def progress() -> None:
        done = _done(folder, wanted)
        spent = time.perf_counter() - began
        left = spent / max(done - at_start, 1) * (total - done) if done > at_start else math.nan
        ahead = f", {left / 60:.0f} min left" if math.isfinite(left) else ""
        print(f"\r{done}/{total} cases, {spent / 60:.1f} min{ahead}   ", end="", file=sys.stderr, flush=True)

    if jobs == 1:
        for batch in listed:
            run_batch(batch, folder, rivals, only_rivals, keep, diagnose)
            progress()
    else:
        with ProcessPoolExecutor(jobs, initializer=_leave_with, initargs=(os.getpid(),)) as pool:
            waiting = {pool.submit(run_batch, b, folder, rivals, only_rivals, keep, diagnose) for b in listed}
            try:
                while waiting:
                    with contextlib.suppress(TimeoutError):
                        done = next(as_completed(waiting, timeout=5.0))
                        done.result()
                        waiting.discard(done)
                    progress()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    print(file=sys.stderr)


def _done(folder: Path, wanted: set[str]) -> int:
    return len(wanted & {p.stem for p in folder.glob("*.json")})


def load(folder: Path, names: Sequence[str]) -> list[dict[str, Any]]:
    """Read the files of cases, in the order of their names."""
    return [json.loads((folder / f"{n}.json").read_text(encoding="utf-8")) for n in names]


def records(results: Sequence[Mapping[str, Any]], method: str) -> list[Record]:
    """Return what was true and what a method answered."""
    from . import judge

    out = []
    for r in results:
        a = r["answers"].get(method)
        if a is None:
            continue
        a = {**a, "causes": tuple(map(tuple, a["causes"])), "interval": tuple(a["interval"]) if a["interval"] else None}
        out.append((judge.truth(r["key"]), Answer(**a)))
    return out
