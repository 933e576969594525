"""Motions that turn between two rows: where dry friction changes its sign."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.between_rows import PIECES
from pamid.gap.residuals.turning import CutSteps, lines
from pamid.signals.paths import steady_path
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import PortLog

FRICTION, MASS, DT = 30.0, 10.0, 5e-3


def rates(t, x, u, p):
    """Return the rates of a sliding mass on a spring."""
    return [x.v, (u.force - p.k * x.x - p.d * x.v) / p.m]


SLIDE = FunctionSimulator(
    rates,
    [
        Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"),
        Port("slide", "joint", "N", position="x", velocity="v"),
    ],
    {"m": (MASS, 0.03, "kg"), "k": (4e3, 0.05, "N/m"), "d": (60.0, 0.1, "N s/m")},
)  # fmt: skip


def slide_log(seed: int = 11) -> pd.DataFrame:
    """Return what sensors see of the slide with friction: it turns in a step of 5 ms at up to 12 Hz."""
    rng, fine, frames = np.random.default_rng(seed), 50, []
    for k in range(2):
        t = np.arange(0.0, 6.0, DT)
        force = 160.0 * np.sin(2 * np.pi * (5.0 + k) * t) + 90.0 * np.sin(2 * np.pi * (11.7 - k) * t + k)
        x, v, rows = 0.0, 0.0, []
        for now in force:
            rows.append((x, v))
            for _ in range(fine):
                v += DT / fine * (now - 4e3 * x - 60.0 * v - FRICTION * np.tanh(v / 1e-3)) / MASS
                x += DT / fine * v
        x, v = np.array(rows).T + rng.standard_normal((2, len(t))) * np.array([[5e-6], [5e-4]])
        frames.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "force": force, "x": x, "v": v}))
    return pd.concat(frames, ignore_index=True)


def test_friction_of_a_fast_motion_is_found_with_its_size() -> None:
    found = diagnose_simulator(slide_log(), SLIDE)
    assert [c.effects for c in found.causes] == [("coulomb_friction",)]
    assert found.causes[0].parameters["amplitude"].value == pytest.approx(FRICTION / MASS, rel=0.03)
    slide = next(c for c in found.closure if c.equation == "slide")
    assert slide.rmse_after < 1.2 * slide.noise_floor


def test_lines_over_a_step_have_the_mean_and_the_moment_of_its_pieces() -> None:
    f = np.random.default_rng(0).standard_normal((3, PIECES + 1))
    a, b = lines(f)
    s = np.linspace(0.0, 1.0, 80 * PIECES + 1)
    each = np.array([np.interp(s, np.arange(PIECES + 1) / PIECES, row) for row in f])
    straight = a[:, None] + (b - a)[:, None] * s
    assert np.allclose(np.trapezoid(each, s), np.trapezoid(straight, s))
    assert np.allclose(np.trapezoid(each * s, s), np.trapezoid(straight * s, s), atol=2e-4)


def with_a_corner(seed: int = 0) -> tuple[np.ndarray, int]:
    """Return a noisy path of 200 rows that rises, and falls from a row on much faster, as where a command jumps."""
    k, corner = np.arange(200), 120
    fall = np.maximum(k - corner, 0)
    path = 3e-3 * np.minimum(k, corner) - 0.02 * fall**1.5 / (1.0 + 0.05 * fall)
    return path + 2e-4 * np.random.default_rng(seed).standard_normal(200), corner


def test_a_steady_path_turns_where_its_command_jumps_not_before() -> None:
    for seed in range(5):
        path, corner = with_a_corner(seed)
        steady = steady_path(path, np.array([0]), 2e-4, 11)
        assert np.argmax(steady) == corner
        assert np.std((steady - path)[5:100]) > 1e-4  # elsewhere noise is smoothed


def test_a_step_before_a_corner_is_not_bent_by_speeds_that_were_smoothed_over_it() -> None:
    path, corner = with_a_corner()
    log = PortLog({}, 0.01 * np.arange(200.0), np.array([0]), 0.01, ["one"])
    smooth = np.convolve(np.gradient(path, 0.01), np.ones(7) / 7.0, mode="same")
    assert CutSteps(path, smooth, log).cut.tolist() == []
    there = np.abs(CutSteps(path, np.gradient(path, 0.01), log).cut - corner)
    assert np.all(there <= 1)


def test_only_the_steps_in_which_a_path_turns_are_cut_and_no_run_goes_on_into_the_next() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    path, velocity = (np.concatenate([x, x]) for x in (np.cos(7.0 * t), -7.0 * np.sin(7.0 * t)))
    log = PortLog({}, np.concatenate([t, t]), np.array([0, 100]), 0.01, ["one", "two"])
    steps = CutSteps(path, velocity, log)
    assert steps.cut.tolist() == [44, 89, 144, 189]
    assert steps.starts.tolist() == [0, 100 + 2 * (PIECES - 1)]
    inside = steps.path(path)[steps.first[44] + np.arange(PIECES)]
    assert np.allclose(inside, np.cos(7.0 * (0.44 + 0.01 * np.arange(PIECES) / PIECES)), atol=1e-6)
    rows, start, end = steps.at_both_ends(np.sign(steps.along(velocity)))
    plain = np.setdiff1d(np.arange(199), [*steps.cut, 99])
    assert np.array_equal(start[plain], rows[plain]) and np.array_equal(end[plain], rows[plain + 1])
    turned = np.pi / 7.0 / 0.01 - 44  # the share of the step at which it turns
    assert 0.5 * (start[44] + end[44]) == pytest.approx(1.0 - 2.0 * turned, abs=1.0 / PIECES)
