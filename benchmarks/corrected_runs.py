"""Corrected simulators of 60 diagnoses: whether they load, run, and close on other runs what the report says.

Every case goes through the command line as a user does: a log and a simulator file, ``pamid diagnose``, and then
everything that it wrote is read again from disk and evaluated on further runs of the same system. The systems and their
effects are in code of their own (`benchmarks/any_simulator`, `benchmarks/_corrected`).
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np
import pandas as pd

from benchmarks._answers import Record, each, keep, kept, times_of
from benchmarks._corrected.cases import CASES


def solve(number: int, seed: int, folder: Path) -> Record:
    """Diagnose a case on the command line; return what became of the files that it wrote."""
    import pamid
    from pamid.cli import main as command

    case, rng = CASES[number], np.random.default_rng([seed, number])
    log, later = case.make(rng, folder)
    log.to_csv(folder / "log.csv", index=False)
    told, errors = io.StringIO(), io.StringIO()
    out = folder / "found"
    argv = ["diagnose", str(folder / "log.csv"), "--sim", str(folder / "sim.toml"), "--out", str(out), "--json"]
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(errors):
        code = command(
            [*argv, "--quiet", *(["--trust"] if case.system not in ("bench", "cylinder seal", "joint") else [])]
        )
    found = json.loads(told.getvalue()) if code == 0 else {}
    names = [
        " or ".join(c["effects"]) + "@" + "/".join(c["where"]) for c in found.get("causes", found.get("families", []))
    ]
    record: Record = {"verdict": found.get("verdict", f"exit {code}"), "causes": names, "loads": False, "runs": False}
    notes = [n for n in found.get("notes", []) if "left out, since it could not" in n or " than the report says" in n]
    record["notes"] = notes
    page = out / "corrected.toml"
    if not page.is_file():
        return record | {"why": "; ".join(notes) or errors.getvalue()[-300:] or "nothing was handed over"}
    if re.search(r'^[^#\n]*"fit"', page.read_text(encoding="utf-8"), re.M):
        record["why"] = 'corrected.toml holds "fit"'
        return record
    try:
        corrected, given = (pamid.read_simulator(p, trust=True) for p in (page, folder / "sim.toml"))
        record["loads"] = True
        before, after = (pamid.evaluate(later, s) for s in (given, corrected))
        record["runs"] = all(np.isfinite(e.rmse) for e in after.values())
        record["models"] = _models(out, later, after)
    except Exception as error:
        return record | {"why": f"{type(error).__name__}: {error}"}
    return record | _closure(found, before, after)


def _closure(found: dict[str, Any], before: Any, after: Any) -> Record:
    """Return how far the gap of the equation that matters most closes on other runs, beside what the report says."""
    main = max(found["where"]["equations"], key=lambda e: e["share"])["equation"]
    said = next(c for c in found["closure"] if c["equation"] == main)
    if main not in before or main not in after:
        return {"why": f"{main} is not evaluated, but {', '.join(after)}"}
    was, now, noise = before[main].rmse, after[main].rmse, after[main].noise_floor
    room = was**2 - noise**2
    closed = min((was**2 - now**2) / room, 1.0) if room > 0 else 0.0
    return {
        "equation": main, "said": [said["closed_share"], *said["ci90"]], "closed": closed,
        "before": was, "after": now, "noise": noise, "said_after": said["rmse_after"],
    }  # fmt: skip


def _models(out: Path, later: pd.DataFrame, page: Any) -> list[str]:
    """Return which models beside the page load and run; raise where one does not."""
    from pamid.simulators import read_simulator

    done = []
    if (out / "corrected.xml").is_file():
        import mujoco

        model = mujoco.MjModel.from_xml_path(str(out / "corrected.xml"))
        mujoco.mj_step(model, mujoco.MjData(model))
        done.append("corrected.xml")
    if (out / "corrected.py").is_file():
        import mujoco

        spec = importlib.util.spec_from_file_location("corrected", out / "corrected.py")
        module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
        spec.loader.exec_module(module)  # type: ignore[union-attr]
        model, acting = module.load()
        data = mujoco.MjData(model)
        with acting:
            mujoco.mj_step(model, data, nstep=50)
        if not np.isfinite(data.qpos).all():
            raise AssertionError("corrected.py gives no finite positions")
        done.append("corrected.py")
    if (out / "corrected.fmu").is_file():
        model = read_simulator(out / "corrected.fmu", trust=True)
        columns = {n: n for n in model.inputs}
        if set(columns) <= set(later.columns):
            t = later["time"].to_numpy()[:200]
            u = np.array([later[n].to_numpy()[:200] for n in model.inputs])
            shown = model.run(t, u, model.numbers, np.zeros(len(model.states)))
            if not np.isfinite(shown).all():
                raise AssertionError("corrected.fmu gives no finite outputs")
        done.append("corrected.fmu")
    return done


def closes(record: Record) -> bool:
    """Return whether a corrected simulator closes on other runs at least what the report's printed interval says."""
    from pamid.report.quantities import share_span

    if "closed" not in record:
        return False
    _, low, high = record["said"]
    printed = re.findall(r"[\d.]+", share_span(low, high))[0]
    step = 10.0 ** -len(printed.partition(".")[2])
    return 100.0 * record["closed"] >= float(printed) - 0.5 * step


def line(record: Record) -> str:
    """Return a case in one line."""
    head = f"{record['verdict']}: {' + '.join(record['causes'])}"
    if "closed" not in record:
        return f"FAILS {head}; {record.get('why')}"
    point, low, high = record["said"]
    return (
        f"{'right' if closes(record) else 'LESS '} {head}; {record['equation']} closes {100 * record['closed']:.2f} %, "
        f"said {100 * point:.2f} ({100 * low:.2f} to {100 * high:.2f}) %; {record['before']:.3g} -> "
        f"{record['after']:.3g}, noise {record['noise']:.3g}, said {record['said_after']:.3g}"
    )


def jobs(seed: int, folder: Path) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""

    def job(number: int) -> Callable[[], Record]:
        def run() -> Record:
            place = folder / str(number)
            place.mkdir(parents=True, exist_ok=True)
            return solve(number, seed, place)

        return run

    return [(f"{k:02d} {case.name}", job(k)) for k, case in enumerate(CASES)]


def summary(records: list[Record]) -> str:
    """Return what they come to."""
    n = len(records)
    return "; ".join(
        f"{word} {sum(map(test, records))} of {n}"
        for word, test in (
            ("load", lambda r: r.get("loads", False)), ("run", lambda r: r.get("runs", False)),
            ("close what the report says", closes),
        )
    )  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    """Run the cases; return 0 when each corrected simulator loads, runs and closes what was said."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="TEXT", help="only cases whose name holds this")
    parser.add_argument("--seed", type=int, default=20_261_125, help="seed of the cases")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes side by side")
    parser.add_argument("--limit", type=float, default=300.0, metavar="S", help="seconds for one case")
    parser.add_argument("--out", type=Path, metavar="FILE", help="keep the cases there, as JSON lines; go on from them")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave logs and answers there")
    args = parser.parse_args(argv)
    done = kept(args.out) if args.out and args.out.is_file() else {}
    with tempfile.TemporaryDirectory() as temporary:
        wanted = [(name, job) for name, job in jobs(args.seed, args.keep or Path(temporary))
                  if not args.only or args.only in name]  # fmt: skip
        records = [done[name] for name, _ in wanted if name in done]
        for name, record in each([j for j in wanted if j[0] not in done], args.limit, args.workers):
            keep(args.out, name, record)
            records.append(record)
            said = record.get("traceback") or record.get("error") or line(record)
            print(f"{name}, {times_of(record)}: {said}", flush=True)
    print(f"\n{summary(records)}")
    return int(not all(r.get("runs") and closes(r) for r in records))


if __name__ == "__main__":
    raise SystemExit(main())
