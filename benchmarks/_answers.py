"""A diagnosis as plain data, many of them in processes of their own with a time limit, and two such runs compared."""

from __future__ import annotations

import json
import multiprocessing
import resource
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

Record = dict[str, Any]
_PROCESSES = multiprocessing.get_context("fork")  # what runs is a closure over simulators, which no pickle holds


def times_of(record: Record) -> str:
    """Return how long a case took, and how much of it on a processor: others may share the machine."""
    return f"{record['seconds']:.0f} s" + (f" ({record['cpu']:.0f} s of CPU)" if "cpu" in record else "")


def answer_of(found: Any) -> Record:
    """Return verdict, causes with sizes and units, grade and closure of a diagnosis as plain data."""
    causes = []
    for c in found.causes:
        sizes = {k: [p.value, *p.ci90, p.unit] for k, p in c.parameters.items()}
        names = [f"{e}@{w}" for e, w in zip(c.effects, c.where or ("",) * len(c.effects), strict=True)]
        said = {"names": names, "share": c.share, "confidence": c.confidence, "grade": grade_of(c), "sizes": sizes}
        causes.append(said)
    noise = [(c.equation, c.rmse_before, c.rmse_after, c.noise_floor, c.closed_share) for c in found.closure]
    return {
        "verdict": found.verdict, "p": found.p_value, "causes": causes, "closure": noise,
        "scores": {f"{c.effect}@{c.where}": c.score for c in found.candidates},
        "refitted": {" + ".join(h.effects): h.gain for h in found.hypotheses},
        "shares": {f"{c.effect}@{c.where}": c.closed_share for c in found.candidates},
    }  # fmt: skip


def grade_of(cause: Any) -> str:
    """Return how firmly a cause is named: its grade, or where it has none whether it stands with reservations."""
    return str(getattr(cause, "grade", "") or ("reserve" if cause.with_reserve else "sure"))


def short(answer: Record) -> str:
    """Return verdict and names in one line."""
    names = " + ".join("/".join(c["names"]) + f" ({c['grade']}, {100 * c['share']:.0f} %)" for c in answer["causes"])
    return answer["verdict"] + (f": {names}" if names else "")


def lines_of(answer: Record) -> list[str]:
    """Return the causes with sizes and the closure, one line each."""
    found = []
    for c in answer["causes"]:
        values = ", ".join(f"{k} {v:.4g} [{lo:.3g}, {hi:.3g}] {u}" for k, (v, lo, hi, u) in c["sizes"].items())
        head = f"{' or '.join(c['names'])}: {c['grade']}, confidence {c['confidence']:.2f}, share {c['share']:.2f}"
        found.append(f"{head}; {values}")
    for equation, before, after, floor, _ in answer["closure"]:
        found.append(f"{equation}: {before:.3g} -> {after:.3g}, noise {floor:.3g}, held out")
    return found


def _served(pipe: Any, job: Callable[[], Record]) -> None:
    begun = time.perf_counter()
    try:
        record = job()
    except Exception as error:
        record = {"error": f"{type(error).__name__}: {error}", "traceback": traceback.format_exc()}
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    cpu = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    pipe.send({"seconds": time.perf_counter() - begun, "cpu": cpu} | record)
    pipe.close()


def each(
    jobs: Sequence[tuple[str, Callable[[], Record]]], limit: float, workers: int = 1
) -> Iterator[tuple[str, Record]]:
    """Run jobs in processes of their own; yield name and record as they come, an ``error`` where time is up."""
    waiting, running = list(jobs)[::-1], {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                name, job = waiting.pop()
                ours, theirs = _PROCESSES.Pipe(duplex=False)
                process = _PROCESSES.Process(target=_served, args=(theirs, job))
                process.start()
                theirs.close()
                running[ours] = (name, process, time.perf_counter())
            oldest = min(begun for _, _, begun in running.values())
            ready = wait(list(running), timeout=max(0.0, oldest + limit - time.perf_counter()))
            for pipe in list(running):
                name, process, begun = running[pipe]
                late = time.perf_counter() - begun > limit
                if pipe not in ready and not late:
                    continue
                try:
                    record = pipe.recv() if pipe in ready else {"error": "no answer in time", "seconds": limit}
                except EOFError:
                    record = {"error": "the process ended without an answer", "seconds": time.perf_counter() - begun}
                process.terminate()
                process.join()
                pipe.close()
                del running[pipe]
                yield name, record
    finally:
        for _, process, _ in running.values():
            process.terminate()


def keep(path: Path | None, name: str, record: Record) -> None:
    """Append a record to a file of JSON lines, if one is wanted."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"case": name} | record, default=float) + "\n")


def kept(path: Path) -> dict[str, Record]:
    """Return the records of a file by case; the last one of a case counts."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {r["case"]: r for r in map(json.loads, lines) if "case" in r}


def compared(one: Path, other: Path) -> list[str]:
    """Return a line for each case whose answer differs between two files, and what they come to."""
    a, b = kept(one), kept(other)
    lines, better, worse = [], 0, 0
    for case in [c for c in a if c in b]:
        first, second = (r.get("said", r.get("error", "")) for r in (a[case], b[case]))
        right = a[case].get("right"), b[case].get("right")
        better, worse = better + (right == (False, True)), worse + (right == (True, False))
        if first != second or right[0] != right[1]:
            word = {(False, True): "better", (True, False): "WORSE"}.get(right, "other")
            times = f"{a[case].get('cpu', 0):.0f} -> {b[case].get('cpu', 0):.0f} s of CPU"
            lines += [f"{word:6s} {case}, {times}", f"         {first}", f"      -> {second}"]
    both = len(a.keys() & b.keys())
    cpu = [sum(r[c].get("cpu", 0.0) for c in a.keys() & b.keys()) for r in (a, b)]
    return [*lines, f"{both} cases in both, {better} better, {worse} worse; {cpu[0]:.0f} -> {cpu[1]:.0f} s of CPU"]
