"""The tables that the check prints: METHOD's figures with ours and the rivals', matrices, what went wrong."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import metrics as m
from . import novelty, several
from .metrics import Figure, Record
from .oracle import decidable
from .runner import METHODS, records

Row = tuple[str, str, Callable[[Sequence[Record]], Figure], Callable[[float], bool], str]


def _percent(limit: float, above: bool) -> Callable[[float], bool]:
    return (lambda v: v >= limit) if above else (lambda v: v <= limit)


ROWS: tuple[Row, ...] = (
    ("false alarms with no gap", "≤ 1 %", m.false_alarms, _percent(0.01, False), "%"),
    ("detected, effect ≥ 15 % of the floor", "≥ 99 %", m.detected, _percent(0.99, True), "%"),
    ("equation located", "≥ 98 %", m.located, _percent(0.98, True), "%"),
    ("region F1", "≥ 0.85", m.region_f1, _percent(0.85, True), "2"),
    ("right effect first: effect ≥ 1 × the floor", "≥ 99 %", lambda r: m.first(r, m.LOUD), _percent(0.99, True), "%"),
    (
        "right effect first: 0.15–1 × the floor", "≥ 95 %", lambda r: m.first(r, m.DETECTABLE, m.LOUD),
        _percent(0.95, True), "%",
    ),
    ("right effect in the first three", "≥ 99 %", m.first_three, _percent(0.99, True), "%"),
    ("truth in the named class", "≥ 98 %", m.in_class, _percent(0.98, True), "%"),
    ("mean size of a class", "≤ 1.5", m.class_size, _percent(1.5, False), "2"),
    ("an off-library effect given a library name", "≤ 5 %", m.off_library_named, _percent(0.05, False), "%"),
    ("the same, without reservations", "≤ 5 %", m.off_library_sure, _percent(0.05, False), "%"),
    ("named causes that are wrong, all logs", "≤ 5 %", m.wrong_names, _percent(0.05, False), "%"),
    ("the same, of those named without reservations", "≤ 5 %", m.wrong_and_sure, _percent(0.05, False), "%"),
    ("effects of the library named with reservations", "–", m.reserved, lambda v: True, "%"),
    ("effects of the library answered with unknown", "≤ 4 %", m.left_unknown, _percent(0.04, False), "%"),
    ("two effects: both", "≥ 90 %", m.both, _percent(0.90, True), "%"),
    ("two effects: at least one", "≥ 98 %", m.one_of_two, _percent(0.98, True), "%"),
    ("calibration error of the confidence (ECE)", "≤ 0.04", m.ece, _percent(0.04, False), "3"),
    ("explainable gap closed, held out, right cause (median)", "≥ 95 %", m.closed, _percent(0.95, True), "%"),
    ("predicted minus realised closed share (median)", "≤ 5 points", m.misjudged, _percent(0.05, False), "p"),
    ("coverage of the 90 % interval", "88–92 %", m.covered, lambda v: 0.88 <= v <= 0.92, "%"),
    ("closed by a wrong family, held out (median)", "≤ 5 %", m.wrong_family, _percent(0.05, False), "%"),
    ("region F1, where the gap is over the floor", "–", m.over_floor_f1, lambda v: True, "2"),
    ("coverage of the closed share to within a point", "–", m.covered_nearly, lambda v: True, "%"),
    ("coverage of the amplitude, if pamid's formula is the same", "–", m.amplitude_covered, lambda v: True, "%"),
    ("confusable effects, poor excitation: right effect first", "–", m.confusable_first, lambda v: True, "%"),
)  # fmt: skip
"""METHOD's table: figure, what is asked, how it is measured, whether it is met, how it is written."""

UNANSWERED = {
    "ranking": ("region F1", "off", "the same", "effects of", "predicted", "coverage"),
    "sindy": ("region F1", "the same", "effects of", "predicted", "coverage"),
    **dict.fromkeys(
        novelty.METHODS,
        (
            "false",
            "detected",
            "equation",
            "region",
            "mean size",
            "the same",
            "effects of the library named",
            "two",
            "explainable",
            "predicted",
            "coverage",
            "closed",
        ),
    ),
    "black box": (
        "region F1",
        "right",
        "truth",
        "mean size",
        "an off",
        "named",
        "the same",
        "effects of",
        "two",
        "calib",
        "predicted",
        "coverage",
        "conf",
    ),
}
"""Beginnings of the rows that a rival has no answer to."""


def shown(figure: Figure, style: str) -> str:
    """Return a figure with its interval and the number of cases behind it."""
    if figure.n == 0 or not math.isfinite(figure.value):
        return "–"
    scale, unit, digits = {"%": (100, " %", 1), "p": (100, " points", 1), "2": (1, "", 2), "3": (1, "", 3)}[style]
    text = f"{figure.value * scale:.{digits}f}{unit}"
    if math.isfinite(figure.low):
        text += f" ({figure.low * scale:.{digits}f}–{figure.high * scale:.{digits}f})"
    return text


def figures(results: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Figure]]:
    """Return every figure of every method that ran."""
    out: dict[str, dict[str, Figure]] = {}
    for method in (*METHODS, *novelty.METHODS):
        listed = records(results, method)
        if not listed:
            continue
        skip = UNANSWERED.get(method, ())
        out[method] = {row[0]: m.NOTHING if row[0].startswith(skip) and skip else row[2](listed) for row in ROWS}
    return out


def table(results: Sequence[Mapping[str, Any]]) -> str:
    """Return METHOD's table in Markdown."""
    measured = figures(results)
    if any(r.get("oracle") is not None for r in results):
        known = decidable(results)
        measured["ours, decidable"] = figures([r for r in results if r["name"] in known])["ours"]
    methods = list(measured)
    lines = [
        "| figure | target | n | " + " | ".join(m.replace("ours", "pamid") for m in methods) + " |",
        "| --- " * (len(methods) + 3) + "|",
    ]
    for name, ask, _, met, style in ROWS:
        n = max((measured[k][name].n for k in methods), default=0)
        cells = []
        for method in methods:
            figure = measured[method][name]
            text = shown(figure, style)
            if method == "ours" and figure.n and math.isfinite(figure.value) and ask != "–":
                text += "" if met(figure.value) else " **missed**"
            cells.append(text)
        lines.append(f"| {name} | {ask} | {n} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def table_of_several(results: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of cases of three to five effects, by how many they have and how they were drawn."""
    columns = {k: listed for k, listed in several.kinds(results).items() if listed}
    heads = [f"{k} ({len(listed)})" for k, listed in columns.items()]
    lines = ["| figure | target | n | " + " | ".join(heads) + " |", "| --- " * (len(heads) + 3) + "|"]
    for name, ask, measure, met, style in several.ROWS:
        measured = [measure(listed) for listed in columns.values()]
        cells = [shown(measured[0], style), *(shown(replace(f, low=math.nan), style) for f in measured[1:])]
        if measured[0].n and not met(measured[0].value):
            cells[0] += " **missed**"
        lines.append(f"| {name} | {ask} | {measured[0].n} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def matrix(counts: Mapping[str, Counter[str]]) -> str:
    """Return a matrix as CSV, the first column its rows' labels."""
    columns = sorted({c for row in counts.values() for c in row})
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["", *columns])
    for label in sorted(counts):
        writer.writerow([label, *(counts[label].get(c, 0) for c in columns)])
    return out.getvalue()


def mistakes(listed: Sequence[Record], top: int = 25) -> str:
    """Return the most frequent wrong answers."""
    counts: Counter[tuple[str, str]] = Counter()
    for label, answers in m.confusion(listed).items():
        for answer, n in answers.items():
            if answer != label:
                counts[label, answer] += n
    lines = ["| true | said | cases |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {t} | {s} | {n} |" for (t, s), n in counts.most_common(top))])


def by_effect(listed: Sequence[Record]) -> str:
    """Return for each name how often it was found, and how often it was right when it was given."""
    there, back = m.confusion(m.of_suite(listed, "single", "none")), m.inversion(listed)
    lines = ["| name | cases | named first | given | right when given |", "| --- | --- | --- | --- | --- |"]
    for label in sorted(set(there) | set(back)):
        own, given = there.get(label, Counter()), back.get(label, Counter())
        n, k = sum(own.values()), sum(given.values())
        found = f"{100 * own[label] / n:.0f} %" if n else "–"
        right = f"{100 * given[label] / k:.0f} %" if k else "–"
        lines.append(f"| {label} | {n} | {found} | {k} | {right} |")
    return "\n".join(lines)


def wrong_families_close(results: Sequence[Mapping[str, Any]]) -> str:
    """Say how much the ranking's fits of wrong families close on held-out trajectories of loud single effects."""
    mean, most = [], []
    for r in results:
        effects = r["key"]["effects"]
        if r["key"]["suite"] != "single" or not r.get("closed_by") or r["key"]["strength"] < m.LOUD:
            continue
        from pamid.effects import all_effects

        right = {e["family"] for e in effects.values()}
        shares = [c for n, c in r["closed_by"].items() if all_effects()[n].family not in right]
        if shares:
            mean.append(float(np.median(shares)))
            most.append(max(shares))
    if not mean:
        return ""
    return (
        f"Fitted on purpose to {len(mean)} loud single cases, an effect of a wrong family closes "
        f"{100 * np.median(mean):.1f} % of the gap on held-out trajectories (median over effects and cases); "
        f"the best wrong one {100 * np.median(most):.1f} %."
    )


def report(results: Sequence[Mapping[str, Any]], command: str) -> str:
    """Return everything that a check found, in Markdown."""
    suites = Counter(r["key"]["suite"] for r in results)
    counted = ", ".join(f"{n} {s}" for s, n in suites.items())
    parts = [f"# Withheld check\n\n`{command}`: {len(results)} cases ({counted}), each with a seed of its own."]
    together = [r for r in results if r["key"]["suite"] == "several"]
    if together:
        parts.append(table_of_several(together))
    if len(together) < len(results):
        parts.append(table([r for r in results if r["key"]["suite"] != "several"]))
    parts.append("Shares have Wilson's 95 % interval, other figures that of the bootstrap over cases.")
    if text := wrong_families_close(results):
        parts.append(text)
    named = {k: listed for k in METHODS[:3] if (listed := records(results, k))}
    parts += [f"## Most frequent mistakes: {k}\n\n{mistakes(listed)}" for k, listed in named.items()]
    if listed := records(results, "ours"):
        seconds = [a.seconds for _, a in listed]
        parts.append(f"## By effect: ours\n\n{by_effect(listed)}")
        parts.append(f"A diagnosis took {np.median(seconds):.1f} s (median), {np.max(seconds):.1f} s at most.")
    errors = [f"- {r['name']}: {r['error']}" for r in results if "error" in r]
    errors += [f"- {r['name']}: out of form: {'; '.join(r['out_of_form'])}" for r in results if r.get("out_of_form")]
    if errors:
        parts.append(f"## Errors ({len(errors)})\n\n" + "\n".join(errors[:40]))
    return "\n\n".join(parts) + "\n"
