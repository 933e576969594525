"""The report on a simulator of one's own: an arm whose motor's speed has one reading that jumps."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose
from pamid.gap.diagnosis.result import Diagnosis
from pamid.plots.curves import drawn
from pamid.report import GapDisplay, report_html
from pamid.report.drawings.maps import axes_of
from pamid.report.drawings.readings import readings_figure
from pamid.simulators import FunctionSimulator, Port

JUMP = 3.0


def rates(t, x, u, p):
    return [x.w, u.u / 0.1]


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """Two runs of a motor with friction that its simulator lacks."""
    rng, runs, dt = np.random.default_rng(1), [], 0.01
    time = dt * np.arange(400)
    for k in range(2):
        u = 2 * np.sin(2 * np.pi * rng.uniform(0.3, 1.5, (3, 1)) * time + rng.uniform(0, 6, (3, 1))).sum(0)
        w = np.zeros(len(time))
        for i in range(1, len(time)):
            w[i] = w[i - 1]
            for _ in range(20):
                w[i] += dt / 20 * (u[i - 1] - 0.6 * np.tanh(w[i] / 0.05)) / 0.1
        q = np.cumsum(w) * dt + 1e-4 * rng.standard_normal(len(time))
        run = pd.DataFrame({"trajectory": f"run {k}", "time": time, "u": u, "q": q, "w": w})
        runs.append(run.assign(w=w + 5e-3 * rng.standard_normal(len(time))))
    log = pd.concat(runs, ignore_index=True)
    log.loc[123, "w"] += JUMP
    ports = [Port("u", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    return diagnose(log, FunctionSimulator(rates, ports), effects=["coulomb_friction"])


def test_axes_say_what_the_equation_is_and_what_the_error_depends_on(found: Diagnosis) -> None:
    display = GapDisplay.from_diagnosis(found)
    (course,) = display.plot("course").axes_
    assert course.get_ylabel() == "acceleration of q / (rad/s²)"
    assert axes_of(found, "q")[0][0] == "w", "friction depends on the speed"
    loop, over_time = display.plot("loop").axes_
    assert (loop.get_xlabel(), loop.get_ylabel()) == ("w / (rad/s)", "error / (rad/s²)")
    assert over_time.get_xlabel() == "time / s"


def test_a_reading_that_jumps_for_one_row_is_seen(found: Diagnosis) -> None:
    figure = readings_figure(found, "run 0")
    assert figure is not None
    command, angle, speed = figure.axes
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["u / N m", "q / rad", "w / (rad/s)"]
    time, shown = (np.asarray(v, dtype=float) for v in speed.lines[0].get_data())
    around = np.abs(time - 1.23) < 0.015
    assert np.ptp(shown[around]) > 0.9 * JUMP
    assert command.lines and angle.lines


def test_no_picture_is_there_twice(found: Diagnosis) -> None:
    pictures = re.findall(r"<svg.*?</svg>", report_html(found), re.S)
    bare = [re.sub(r'id="[^"]*"|url\(#[^)]*\)|href="#[^"]*"|aria-label="[^"]*"', "", text) for text in pictures]
    assert len(pictures) >= 8 and len(set(bare)) == len(bare)


@pytest.mark.parametrize("row", [0, 1, 54_321, 99_999])
def test_curves_keep_what_one_row_shows(row: int) -> None:
    time = 1e-3 * np.arange(100_000)
    y = np.sin(time)
    y[row] = -7.0
    t, shown, other = drawn(time, y, np.cos(time))
    assert len(t) == len(shown) == len(other) < 5_000
    assert t[np.argmin(shown)] == time[row] and shown.min() == -7.0


def test_no_line_crosses_a_gap() -> None:
    time = np.concatenate([0.01 * np.arange(5_000), 90 + 0.01 * np.arange(5_000)])
    t, y = drawn(time, np.where(time < 60, 1.0, 2.0))
    assert np.isnan(t).sum() == np.isnan(y).sum() == 1
    before, after = np.split(y, np.flatnonzero(np.isnan(y)))
    assert set(before) == {1.0} and set(after[1:]) == {2.0}
    assert len(drawn(time[:1], time[:1])[0]) == 1


def test_of_many_signals_those_are_drawn_that_tell_of_the_error(found: Diagnosis) -> None:
    ports = [Port(f"idle{k}", "input", "V") for k in range(6)]
    many = FunctionSimulator(rates, [*ports, *found.nominal.ports])
    (log,) = found.history.logs.values()
    history = replace(found.history, logs={"log": log.assign(**{p.name: 0.0 for p in ports})})
    figure = readings_figure(replace(found, nominal=many, history=history), "run 0", "q")
    assert figure is not None
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert len(titles) == 6 and titles[-3:] == ["u / N m", "q / rad", "w / (rad/s)"]


def test_of_a_long_run_the_worst_part_is_drawn_closely_with_every_reading() -> None:
    rng, t = np.random.default_rng(3), 0.01 * np.arange(8000)
    log = pd.DataFrame({"trajectory": "7", "time": t, "u": np.sin(9 * t)})
    log["y"] = 2 * log["u"] + 0.5 * np.exp(-np.square(t - 60)) + 1e-2 * rng.standard_normal(len(t))
    log.loc[6012, "y"] += JUMP
    ports = [Port("u", "input", "V"), Port("y", "output", "N")]
    found = diagnose(log, FunctionSimulator(lambda u, p: 2 * u.u, ports), effects=["sensor_gain"])
    whole, close = GapDisplay.from_diagnosis(found).plot("course").axes_
    assert whole.get_ylabel() == close.get_ylabel() == "y / N"
    (grey,) = whole.patches
    at = close.get_xlim()
    assert at[0] <= grey.get_x() < 60.12 < grey.get_x() + grey.get_width() <= at[1]
    for ax in (whole, close):
        lines = {
            str(line.get_label()).partition(",")[2]: line for line in ax.lines if "measured" in str(line.get_label())
        }
        time, shown = (np.asarray(v, dtype=float) for v in lines[" every row"].get_data())
        assert np.ptp(shown[np.abs(time - 60.12) < 0.05]) > 0.9 * JUMP
    assert len(time) > 2 * len(lines[""].get_xdata())
    assert ">y in run 7." in report_html(found)
