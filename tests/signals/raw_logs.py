"""Raw logs with odd headers, units, clocks and preambles, made from simulated runs; run as a script it prints a table."""

# ruff: noqa: E501 - a log is one line
from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io

from pamid.bench import BenchParameters, simulate, sine
from pamid.systems.cylinder import Cylinder
from pamid.systems.muscle import Muscle

AMBIENT = 101_325.0
# SI units in one unit, written down here by themselves: the package's own table must not check itself.
FACTOR = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "bar": 1e5,
    "mbar": 1e2, "psi": 6894.757, "kp/cm2": 98066.5, "mmHg": 133.3224, "N": 1.0, "daN": 10.0, "kN": 1e3, "mN": 1e-3,
    "kgf": 9.80665, "lbf": 4.448222, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "%": 1e-2, "1": 1.0, "rad": 1.0,
    "deg": np.pi / 180, "g/s": 1e-3, "NL/min": 1.2929e-3 / 60, "LANR": 1.185e-3 / 60, "Nm": 1.0, "V": 1.0,
}  # fmt: skip
CYLINDER = ("--kind", "cylinder", "--set", "bore=25 mm")
MUSCLE = ("--kind", "muscle", "--set", "rest_length=200 mm", "--set", "rest_diameter=20 mm")
JOINT = ("--kind", "joint")
BENCH = ("--kind", "bench", "--set", "rest_length=200 mm")


def cylinder(k: int = 0) -> pd.DataFrame:
    """Return a run of a cylinder of 25 mm with dry friction."""
    rng, t = np.random.default_rng(k), np.arange(0, 4, 0.01)
    x, v = 0.025 + 0.015 * np.sin((2 + k) * t), 0.015 * (2 + k) * np.cos((2 + k) * t)
    P = AMBIENT + 2.2e5 + 1e5 * np.sin(0.9 * t + k) + 30 * rng.standard_normal(len(t))
    run = pd.DataFrame({"trajectory": "0", "time": t, "x": x, "P": P, "F": 0.0})
    problem = Cylinder(bore=0.025).problem(run)
    return run.assign(F=problem.nominal(problem.X) + 5 * np.tanh(v / 2e-3) + 0.1 * rng.standard_normal(len(t)))


def muscle(k: int = 0) -> pd.DataFrame:
    """Return a run of a muscle of 200 mm and 20 mm with dry friction, from ambient pressure."""
    rng, t = np.random.default_rng(k), np.arange(0, 4, 0.01)
    eps, deps = 0.1 + 0.05 * np.sin((2 + k) * t), 0.05 * (2 + k) * np.cos((2 + k) * t)
    P = AMBIENT + 1.5e5 * (1 - np.cos(0.8 * t)) + 30 * rng.standard_normal(len(t))
    run = pd.DataFrame({"trajectory": "0", "time": t, "eps": eps, "P": P, "F": 0.0})
    problem = Muscle(rest_length=0.2, rest_diameter=0.02).problem(run)
    F = problem.nominal(problem.X) - 4 * np.tanh(deps / 5e-3) + 0.1 * rng.standard_normal(len(t))
    return run.assign(F=F, L=0.2 * (1 - eps), s=0.2 * eps, mdot=2e-5 * np.sin(0.8 * t))


def joint(k: int = 0) -> pd.DataFrame:
    """Return a run of a lever driven by a torque."""
    t = np.arange(0, 4, 0.01)
    q, w = 0.8 * np.sin((2 + k) * t), 0.8 * (2 + k) * np.cos((2 + k) * t)
    drive = 0.5 * np.sin(q) - 0.01 * (2 + k) ** 2 * q + 0.05 * np.tanh(w / 0.05)
    return pd.DataFrame({"trajectory": "0", "time": t, "q": q, "drive": drive})


def bench(k: int = 0) -> pd.DataFrame:
    """Return a run of the simulator of the antagonistic bench."""
    return simulate(BenchParameters.for_muscle("B"), [sine(4 + 2 * k, 12, samples=400)], seed=k)


@dataclass(frozen=True)
class RawLog:
    """A raw log: its columns as "header: signal unit [g]", how it is written, and what `pamid init` is told."""

    name: str
    manner: str
    run: Callable[[int], pd.DataFrame]
    columns: str
    argv: tuple[str, ...]
    stops: str = ""
    write: str = "csv"
    runs: int = 1

    def raw(self, truth: pd.DataFrame) -> pd.DataFrame:
        """Return the columns as they stand in the file."""
        found = {}
        for line in self.columns.strip().splitlines():
            header, _, rule = line.strip().rpartition(": ")
            signal, _, unit = rule.partition(" ")
            unit, _, reference = unit.partition(" ")
            if signal == "seq":
                found[header] = np.arange(len(truth), dtype=float)
            elif signal == "text":
                found[header] = unit
            elif signal == "constant":
                found[header] = float(unit)
            else:
                values = truth[signal].to_numpy(dtype=float) - (AMBIENT if reference == "g" else 0.0)
                found[header] = values / FACTOR[unit]
        return pd.DataFrame(found)

    def make(self, folder: Path) -> tuple[list[Path], pd.DataFrame]:
        """Write the log; return its files and the truth in SI, run after run."""
        truths = [self.run(k) for k in range(self.runs)]
        files = [WRITERS[self.write](self.raw(truth), folder / f"log-{k}") for k, truth in enumerate(truths)]
        return files, pd.concat(truths, ignore_index=True)


# --- how programs write -----------------------------------------------------------------------------------------
def _text(
    frame: pd.DataFrame, path: Path, before: str = "", sep: str = ",", decimal: str = ".", **more: object
) -> Path:
    path = path.with_suffix(".csv")
    body = frame.to_csv(sep=sep, decimal=decimal, index=False, float_format="%.9g", lineterminator="\n", **more)
    path.write_text(before + body, encoding="utf-8")
    return path


def _unit_row(frame: pd.DataFrame, path: Path) -> Path:
    """Names in one row, units in the next, as spreadsheets and data loggers have it."""
    names, units = zip(*(str(c).split("|") for c in frame.columns), strict=True)
    body = frame.to_csv(sep=";", decimal=",", index=False, header=False, float_format="%.9g", lineterminator="\n")
    path = path.with_suffix(".csv")
    path.write_text(";".join(names) + "\n" + ";".join(units) + "\n" + body, encoding="utf-8")
    return path


def _labview(frame: pd.DataFrame, path: Path) -> Path:
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    head += "Operator\tlab\nDate\t2024/03/05\nTime\t14:02:11.5\n***End_of_Header***\t\n"
    return _text(frame, path.with_suffix(".lvm"), head, sep="\t").rename(path.with_suffix(".txt"))


def _german(frame: pd.DataFrame, path: Path) -> Path:
    return _text(frame, path, sep=";", decimal=",")


def _preamble(frame: pd.DataFrame, path: Path) -> Path:
    head = "Messprotokoll;Zylinder 25 mm\nDatum;05.03.2024\nPrüfer;Labor\n\n"
    return _text(frame, path, head, sep=";", decimal=",")


def _comments(frame: pd.DataFrame, path: Path) -> Path:
    return _text(frame, path, "# recorded at the rig\n# bore 25 mm\n")


def _tabs(frame: pd.DataFrame, path: Path) -> Path:
    return _text(frame, path, sep="\t")


def _latin(frame: pd.DataFrame, path: Path) -> Path:
    path = _german(frame, path)
    path.write_bytes(path.read_text(encoding="utf-8").encode("latin-1"))
    return path


def _stamps(frame: pd.DataFrame, path: Path, pattern: str) -> Path:
    clock = pd.Timestamp("2024-03-05 14:02:11") + pd.to_timedelta(frame.iloc[:, 0], unit="s")
    frame = frame.assign(**{str(frame.columns[0]): clock.dt.strftime(pattern).str.slice(0, -3)})
    return _text(frame, path)


def _iso(frame: pd.DataFrame, path: Path) -> Path:
    return _stamps(frame, path, "%Y-%m-%dT%H:%M:%S.%f")


def _local(frame: pd.DataFrame, path: Path) -> Path:
    return _stamps(frame, path, "%d.%m.%Y %H:%M:%S.%f")


def _matlab(frame: pd.DataFrame, path: Path) -> Path:
    path = path.with_suffix(".mat")
    scipy.io.savemat(path, {str(c): frame[c].to_numpy() for c in frame.columns})
    return path


def _parquet(frame: pd.DataFrame, path: Path) -> Path:
    path = path.with_suffix(".parquet")
    frame.to_parquet(path, index=False)
    return path


def _json(frame: pd.DataFrame, path: Path) -> Path:
    path = path.with_suffix(".json")
    path.write_text(json.dumps({"rig": "A", "entries": frame.to_dict("records")}))
    return path


def _nameless(frame: pd.DataFrame, path: Path) -> Path:
    return _text(frame, path, sep=" ", header=False)


WRITERS: dict[str, Callable[[pd.DataFrame, Path], Path]] = {
    "csv": _text, "german": _german, "preamble": _preamble, "comments": _comments, "tabs": _tabs, "latin": _latin,
    "units": _unit_row, "labview": _labview, "iso": _iso, "local": _local, "matlab": _matlab, "parquet": _parquet,
    "json": _json, "nameless": _nameless,
}  # fmt: skip


def _c(name: str, manner: str, columns: str, *argv: str, **more: object) -> RawLog:
    return RawLog(name, manner, cylinder, columns, (*CYLINDER, *argv), **more)  # type: ignore[arg-type]


def _m(name: str, manner: str, columns: str, *argv: str, **more: object) -> RawLog:
    return RawLog(name, manner, muscle, columns, (*MUSCLE, *argv), **more)  # type: ignore[arg-type]


def _j(name: str, manner: str, columns: str, *argv: str, **more: object) -> RawLog:
    return RawLog(name, manner, joint, columns, (*JOINT, *argv), **more)  # type: ignore[arg-type]


def _b(name: str, manner: str, columns: str, *argv: str, **more: object) -> RawLog:
    return RawLog(name, manner, bench, columns, (*BENCH, *argv), **more)  # type: ignore[arg-type]


_BENCH = "time [s]: time s\nq [deg]: q deg\n"

RAW_LOGS = [
    # --- cylinders ----------------------------------------------------------------------------------------------
    _c("cylinder-si", "pamid", "time: time s\nx: x m\nP: P Pa\nF: F N"),
    _c("cylinder-si-gauge", "pamid", "time: time s\nx: x m\np: P Pa g\nF: F N"),
    _c("cylinder-brackets", "spreadsheet", "Time [s]: time s\nStroke [mm]: x mm\nPressure [barg]: P bar g\nForce [N]: F N"),
    _c("cylinder-absolute", "spreadsheet", "Time [s]: time s\nStroke [mm]: x mm\nPressure [bara]: P bar\nForce [N]: F N"),
    _c("cylinder-by-force", "spreadsheet", "t [s]: time s\nPosition [mm]: x mm\nPressure [bar]: P bar g\nForce [N]: F N"),
    _c("cylinder-by-force-abs", "spreadsheet", "t [s]: time s\nPosition [mm]: x mm\nPressure [bar]: P bar\nForce [N]: F N"),
    _c("cylinder-german", "spreadsheet", "Zeit [ms]: time ms\nHub [mm]: x mm\nÜberdruck [bar]: P bar g\nKraft [N]: F N", write="german"),
    _c("cylinder-latin", "spreadsheet", "Zeit [ms]: time ms\nHub [mm]: x mm\nÜberdruck [mbar]: P mbar g\nKraft [N]: F N", write="latin"),
    _c("cylinder-dekanewton", "spreadsheet", "Zeit [s]: time s\nWeg [mm]: x mm\nDruck [bar]: P bar g\nKraft [daN]: F daN", write="german"),
    _c("cylinder-kilopond", "old logger", "Zeit in s: time s\nHub in mm: x mm\nDruck in kp/cm²: P kp/cm2 g\nKraft in kp: F kgf", write="german"),
    _c("cylinder-imperial", "LabVIEW", "Time (s): time s\nStroke (in): x in\nPressure (psig): P psi g\nForce (lbf): F lbf"),
    _c("cylinder-imperial-abs", "LabVIEW", "Time (s): time s\nStroke (inch): x in\nPressure (psia): P psi\nForce (lbs): F lbf"),
    _c("cylinder-slashes", "DIN", "t / s: time s\nx / mm: x mm\np_abs / bar: P bar\nF / kN: F kN", write="german"),
    _c("cylinder-slashes-tight", "DIN", "t/s: time s\nx/mm: x mm\nDruck/hPa: P hPa g\nF/daN: F daN"),
    _c("cylinder-underscores", "dSPACE", "time_s: time s\nstroke_mm: x mm\npressure_kPa_gauge: P kPa g\nforce_N: F N"),
    _c("cylinder-camel", "Simulink", "timeMs: time ms\nstrokeMm: x mm\npressureKPa: P kPa g\nforceN: F N"),
    _c("cylinder-megapascal", "Simulink", "t_s: time s\nx_mm: x mm\np_MPa_abs: P MPa\nF_N: F N"),
    _c("cylinder-newton-per-mm2", "old logger", "Zeit (s): time s\nWeg (cm): x cm\nDruck (N/mm²): P MPa g\nKraft (kN): F kN"),
    _c("cylinder-weight", "spreadsheet", "Time [s]: time s\nTravel [mm]: x mm\nPressure [bar]: P bar g\nLoad [kg]: F kgf"),
    _c("cylinder-mercury", "old logger", "Time [s]: time s\nStroke [mm]: x mm\nPressure [mmHg]: P mmHg g\nForce [N]: F N"),
    _c("cylinder-only-units", "logger", "[ms]: time ms\n[mm]: x mm\n[bar]: P bar g\n[N]: F N"),
    _c("cylinder-unit-row", "logger", "Zeit|s: time s\nHub|mm: x mm\nDruck|bar: P bar g\nKraft|daN: F daN", write="units"),
    _c("cylinder-preamble", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck [bar]: P bar g\nKraft [N]: F N", write="preamble"),
    _c("cylinder-comments", "script", "t [s]: time s\nx [mm]: x mm\np [bar]: P bar g\nF [N]: F N", write="comments"),
    _c("cylinder-labview", "LabVIEW", "X_Value [s]: time s\nStroke [mm]: x mm\nPressure [bar]: P bar g\nForce [N]: F N", write="labview"),
    _c("cylinder-iso", "Python", "timestamp: time s\nstroke [mm]: x mm\npressure [bar]: P bar g\nforce [N]: F N", write="iso"),
    _c("cylinder-local", "spreadsheet", "Datum: time s\nHub [mm]: x mm\nDruck [bar]: P bar g\nKraft [N]: F N", write="local"),
    _c("cylinder-microseconds", "Arduino", "micros [us]: time us\nstroke [mm]: x mm\npressure [kPa]: P kPa g\nforce [N]: F N"),
    _c("cylinder-minutes", "logger", "time [min]: time min\nstroke [mm]: x mm\npressure [kPa]: P kPa g\nforce [N]: F N"),
    _c("cylinder-ros", "ROS", "%time: time ns\nfield.header.seq: seq\nfield.position_mm: x mm\nfield.pressure_kpa: P kPa g\nfield.force: F N"),
    _c("cylinder-three-runs", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck [bar]: P bar g\nKraft [N]: F N", runs=3),
    _c("cylinder-setpoint", "dSPACE", "time [s]: time s\nstroke [mm]: x mm\npressure_cmd [bar]: constant 3\npressure [bar]: P bar g\nforce [N]: F N"),
    _c("cylinder-supply", "dSPACE", "Zeit [s]: time s\nHub [mm]: x mm\nVersorgungsdruck [bar]: constant 7\nKammerdruck [bar]: P bar g\nKraft [N]: F N"),
    _c("cylinder-raw-voltage", "LabVIEW", "Time [s]: time s\nStroke [mm]: x mm\nPressure [V]: constant 3\nPressure [bar]: P bar g\nForce [N]: F N"),
    _c("cylinder-parquet", "Python", "time: time s\nstroke [mm]: x mm\npressure [kPa]: P kPa g\nforce [N]: F N", write="parquet"),
    _c("cylinder-json", "Python", "time: time s\nstroke_mm: x mm\npressure_kPa: P kPa g\nforce_N: F N", write="json"),
    _c("cylinder-matlab", "MATLAB", "t_s: time s\nx_mm: x mm\np_bar: P bar g\nF_N: F N", write="matlab"),
    _c("cylinder-nameless", "MATLAB", "a: time ms\nb: x mm\nc: P bar g\nd: F N", "--signal", "x=1:mm", "--signal", "P=2:bar:gauge", "--signal", "F=3:N", write="nameless"),
    # --- cylinders that are stopped -----------------------------------------------------------------------------
    _c("stop-unknown-unit", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck [bar]: P bar g\nKraft [Nx]: F N", stops="'Nx'"),
    _c("stop-two-pressures", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck A [bar]: P bar g\nDruck B [bar]: constant 1\nKraft [N]: F N", stops="'Druck A [bar]' and 'Druck B [bar]'"),
    _c("stop-only-voltage", "LabVIEW", "Time [s]: time s\nStroke [mm]: x mm\nPressure [V]: P bar g\nForce [N]: F N", stops="its unit V is a unit of voltage"),
    _c("stop-unit-left-out", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck [bar]: P bar g\nKraft: F daN", stops="the unit of F is only assumed"),
    _c("stop-pressure-left-out", "spreadsheet", "Zeit [s]: time s\nHub [mm]: x mm\nDruck: P psi g\nKraft [N]: F N", stops="the unit of P is only assumed"),
    _c("stop-no-names", "MATLAB", "a: time ms\nb: x mm\nc: P bar g\nd: F N", write="nameless", stops="No column is known to be x"),
    # --- muscles ------------------------------------------------------------------------------------------------
    _m("muscle-si", "pamid", "time: time s\neps: eps 1\nP: P Pa\nF: F N"),
    _m("muscle-percent", "spreadsheet", "Time [s]: time s\nContraction [%]: eps %\nPressure [bar]: P bar g\nForce [N]: F N"),
    _m("muscle-length", "spreadsheet", "Time [s]: time s\nLength [mm]: L mm\nPressure [bar]: P bar g\nForce [N]: F N"),
    _m("muscle-german", "dSPACE", "Zeit [s]: time s\nLänge [mm]: L mm\nÜberdruck [kPa]: P kPa g\nZugkraft [N]: F N", write="german"),
    _m("muscle-shortening", "LabVIEW", "Zeit (ms): time ms\nVerkürzung (mm): s mm\nDruck (bar): P bar g\nKraft (daN): F daN", write="tabs"),
    _m("muscle-contraction-mm", "Simulink", "time: time s\ncontraction_mm: s mm\np_bar: P bar g\nF_N: F N"),
    _m("muscle-load-cell", "Arduino", "millis [ms]: time ms\ndisplacement [mm]: s mm\npressure [psi]: P psi g\nload cell [kg]: F kgf"),
    _m("muscle-flow", "rig", "t [s]: time s\neps: eps 1\npressure [bar]: P bar g\nflow [NL/min]: mdot NL/min\nforce [N]: F N"),
    _m("muscle-flow-anr", "rig", "Zeit [s]: time s\nKontraktion [%]: eps %\nDruck [bar]: P bar g\nDurchfluss [l/min ANR]: mdot LANR\nKraft [N]: F N"),
    _m("muscle-massflow", "rig", "t_s: time s\neps: eps 1\np_kPa: P kPa g\nmassflow_g_s: mdot g/s\nforce_N: F N"),
    _m("muscle-matlab", "MATLAB", "t: time s\ncontraction: eps 1\npressure_kPa: P kPa g\nforce_N: F N", write="matlab"),
    _m("muscle-iso", "ROS", "timestamp: time s\nlength_mm: L mm\npressure_kPa: P kPa g\ntension_N: F N", write="iso"),
    _m("stop-flow-conditions", "rig", "t [s]: time s\neps: eps 1\npressure [bar]: P bar g\nflow [l/min]: mdot NL/min\nforce [N]: F N", stops="at which conditions"),
    _m("stop-no-position", "rig", "t [s]: time s\npressure [bar]: P bar g\nforce [N]: F N", stops="--constant length"),
    _m("stop-no-target", "rig", "t [s]: time s\neps: eps 1\npressure [bar]: P bar g", stops="No column is known to be F"),
    # --- joints -------------------------------------------------------------------------------------------------
    _j("joint-si", "pamid", "time: time s\nq: q rad\ndrive: drive Nm"),
    _j("joint-ros", "ROS", "time: time s\nposition: q rad\nvelocity: constant 0\neffort: drive Nm"),
    _j("joint-degrees", "dSPACE", "Zeit [s]: time s\nGelenkwinkel [°]: q deg\nDrehzahl [U/min]: constant 3\nDrehmoment [Nm]: drive Nm", write="german"),
    _j("joint-grad", "spreadsheet", "Zeit [ms]: time ms\nWinkel [Grad]: q deg\nMoment [Nm]: drive Nm", write="german"),
    _j("joint-setpoint", "Simulink", "time_s: time s\ntheta_ref_deg: constant 9\ntheta_deg: q deg\ncurrent_A: drive Nm"),
    _j("stop-no-drive", "servo", "time [s]: time s\nangle [deg]: q deg", stops="--signal drive=COLUMN"),
    _j("stop-no-gain", "servo", "time [s]: time s\nangle [deg]: q deg\ngoal [deg]: q deg", stops="No column is known"),
    # --- benches ------------------------------------------------------------------------------------------------
    _b("bench-si", "pamid", "time: time s\nq: q rad\nP1: P1 Pa\nP2: P2 Pa\nF1: F1 N\nF2: F2 N"),
    _b("bench-sides", "dSPACE", f"{_BENCH}p_left [barg]: P1 bar g\np_right [barg]: P2 bar g\nF_left [N]: F1 N\nF_right [N]: F2 N"),
    _b("bench-german", "dSPACE", "Zeit [ms]: time ms\nGelenkwinkel [°]: q deg\nDruck links [bar abs]: P1 bar\nDruck rechts [bar abs]: P2 bar\nKraft links [N]: F1 N\nKraft rechts [N]: F2 N", write="german"),
    _b("bench-agonist", "MATLAB", "time_s: time s\nangle_deg: q deg\npressure_agonist_kPa_abs: P1 kPa\npressure_antagonist_kPa_abs: P2 kPa"),
    _b("stop-bench-reference", "dSPACE", f"{_BENCH}p_left [bar]: P1 bar g\np_right [bar]: P2 bar g", stops="may be gauge or absolute"),
]  # fmt: skip
"""The logs; those with `stops` must be refused, with these words."""


def headers(log: RawLog) -> list[str]:
    """Return the names of the columns of a log, as its file has them."""
    return [line.strip().rpartition(": ")[0].replace("|", " + ") for line in log.columns.strip().splitlines()]


def table() -> str:
    """Return the logs as a table of Markdown; what each comes to is what the tests hold it to."""
    lines = ["| log | as written by | columns | outcome |", "| --- | --- | --- | --- |"]
    for log in RAW_LOGS:
        named = "none" if log.write == "nameless" else ", ".join(f"`{h}`" for h in headers(log))
        outcome = f"stopped: {log.stops}" if log.stops else "right"
        lines.append(f"| {log.name} | {log.manner}, {log.write} | {named} | {outcome} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
