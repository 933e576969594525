"""Plots: what they show, with units, and how they reach a file."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GeometricForce, PolynomialFlow, SINDyRegressor

from pamid.compare.comparison import Comparison, Score
from pamid.errors import IncompatibleError, MissingColumnError, OutputError, ParameterError, UnknownOptionError
from pamid.plots import ForceMapDisplay, VolumeDisplay, comparison_plot, fit_plot, save_figure, volume_plot
from pamid.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, new_figure
from pamid.volume.braided import chou_hannaford
from pamid.volume.functions import flow as volume_flow
from pamid.volume.polynomial import PolynomialVolume

SIZE = {"rest_length": 0.2, "rest_diameter": 0.02, "braid_angle": 0.4363}


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 300), "P": rng.uniform(2e5, 6e5, 300)})
    force = chou_hannaford(X["P"].to_numpy(), X["eps"].to_numpy(), rest_diameter=0.02, braid_angle=0.4363)
    return X, force


@pytest.fixture(scope="module")
def fitted(data):
    return GeometricForce(**SIZE).fit(*data)


@pytest.fixture(scope="module")
def comparison():
    rng = np.random.default_rng(0)
    names = np.repeat(["a-1", "b-1", "c-1", "held"], 50)
    time = np.tile(np.arange(50) * 0.01, 4)
    eps = np.where(names == "held", 0.1, 0.1 + 0.05 * np.sin(10 * time))
    rows = pd.DataFrame({"trajectory": names, "run": names, "time": time, "eps": eps, "P": 3e5 + 1e5 * time})
    rows = rows.assign(deps=0.0, dP=1e5, measured=300 - 1000 * eps)
    noise = rng.normal(size=200) * np.repeat([1.0, 2.0, 3.0, 4.0], 50)
    predictions = {"good": rows["measured"].to_numpy() + noise, "bad": rows["measured"].to_numpy() + 30 * noise}
    scores = [
        Score("good", 2.7, 1.5, 3.5, 0.1, 0.0, 0.0, 0.0),
        Score("bad", 80.0, 40.0, 110.0, 3.0, 77.0, 40.0, 100.0, differs=True),
        Score("broken", error="it broke"),
    ]
    return Comparison("force", "N", scores, rows, predictions, {}, 0.5, 4, 4)


def labels(figure):
    return [text for ax in figure.axes for text in (ax.get_xlabel(), ax.get_ylabel()) if text]


def test_comparison_plot(comparison, tmp_path):
    figure = comparison_plot(comparison, tmp_path / "c.png", title="log")
    ax = figure.axes[0]
    assert [t.get_text() for t in ax.get_yticklabels()] == ["good", "bad"]
    assert ax.get_xscale() == "log"
    assert "/ N" in ax.get_xlabel()
    drawn = {line.get_color() for line in ax.lines if line.get_marker() == "o"}
    assert drawn == {BLUE, GREY}
    assert sorted(float(line.get_xdata()[0]) for line in ax.lines if line.get_marker() == "o") == [2.7, 80.0]
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")


def test_a_flow_is_shown_in_milligrams(comparison):
    scores = [Score("one", 2e-6, 1e-6, 3e-6, 0.1, 0.0, 0.0, 0.0)]
    flow = Comparison(
        "flow", "kg/s", scores, comparison.rows, {"one": comparison.predictions["good"]}, {}, np.nan, 4, 4
    )
    ax = comparison_plot(flow).axes[0]
    assert "mg/s" in ax.get_xlabel()
    assert [float(line.get_xdata()[0]) for line in ax.lines if line.get_marker() == "o"] == [2.0]
    assert all("mg/s" in axis.get_ylabel() for axis in fit_plot(flow).axes if axis.get_ylabel())


def test_fit_plot_shows_best_median_and_worst(comparison, tmp_path):
    figure = fit_plot(comparison, "good", tmp_path / "f.svg")
    titles = [ax.get_title(loc="left") for ax in figure.axes[:3]]
    assert [t.split(":")[0] for t in titles] == ["best", "median", "worst"]
    assert [t.split("\n")[1] for t in titles] == ["a-1", "c-1", "held"]
    # where the contraction is held, a loop over it would be a line
    assert [ax.get_xlabel() for ax in figure.axes[3:]] == ["contraction / %"] * 2 + ["pressure / bar, absolute"]
    measured, predicted = figure.axes[0].lines
    np.testing.assert_allclose(measured.get_ydata(), comparison.rows["measured"][:50])
    np.testing.assert_allclose(predicted.get_ydata(), comparison.predictions["good"][:50])
    assert "<svg" in (tmp_path / "f.svg").read_text()
    with pytest.raises(UnknownOptionError, match="broken"):
        fit_plot(comparison, "broken")


def test_gaps_are_not_drawn_over(comparison):
    kept = (comparison.rows["time"] < 0.1) | (comparison.rows["time"] > 0.3)
    part = Comparison(
        "force", "N", comparison.scores, comparison.rows[kept], {"good": comparison.predictions["good"][kept]}, {}, 0.5,
        4, 4,
    )  # fmt: skip
    line = fit_plot(part).axes[0].lines[0]
    assert np.isnan(line.get_ydata()).sum() == 1


def test_volume_plot_agrees_with_the_geometry(fitted, data, tmp_path):
    figure = volume_plot(fitted, data[0], tmp_path / "v.png", **SIZE)
    assert all("/" in text for text in labels(figure))
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    nominal, cylinder = lines["nominal geometry"].get_ydata(), lines["cylinder"].get_ydata()
    assert cylinder[0] > cylinder[-1]
    pressures = [line for name, line in lines.items() if "bar" in name]
    assert len(pressures) == 3
    for line in pressures:
        shown = np.isfinite(line.get_ydata())
        np.testing.assert_allclose(line.get_ydata()[shown], nominal[shown], rtol=1e-6)


def test_volume_display(fitted, data):
    display = VolumeDisplay.from_estimator(fitted, data[0], n_pressures=2)
    ax = new_figure(4, 3)[1][0, 0]
    assert display.plot(ax, slope=True).ax_ is ax
    assert display.V.shape == (2, len(display.eps))
    np.testing.assert_allclose(np.gradient(display.V[0], display.eps)[5:-5], display.V_eps[0][5:-5], rtol=1e-3)
    with pytest.raises(IncompatibleError, match="no volume"):
        VolumeDisplay.from_estimator(SINDyRegressor(inputs=("eps", "P")).fit(*data), data[0])
    with pytest.raises(MissingColumnError, match="eps"):
        VolumeDisplay.from_estimator(fitted, data[0].drop(columns="eps"))


def test_a_flow_model_has_a_volume_too(data):
    rng = np.random.default_rng(1)
    X = data[0].assign(deps=rng.normal(0, 0.5, 300), dP=rng.normal(0, 1e6, 300))[["eps", "deps", "P", "dP"]]
    mdot = volume_flow(PolynomialVolume(0.2, (6e-5, 5e-4, -9e-4)), X["P"], X["dP"], X["eps"], X["deps"])
    figure = volume_plot(PolynomialFlow(degree=2).fit(X, mdot), X, **SIZE)
    assert len(figure.axes) == 2


def test_force_map(fitted, data):
    display = ForceMapDisplay.from_estimator(fitted, data[0], n_points=20)
    eps, p = np.meshgrid(display.eps, display.p_gauge)
    expected = chou_hannaford(p + 101_325.0, eps, rest_diameter=0.02, braid_angle=0.4363)
    np.testing.assert_allclose(display.force, expected, rtol=1e-6)
    display.plot(new_figure(4, 3)[1][0, 0])
    assert all("/" in text for text in labels(display.figure_))
    with pytest.raises(ParameterError, match="at least 2"):
        ForceMapDisplay.from_estimator(fitted, data[0], n_points=1)


def test_files_are_whole_or_not_there(tmp_path):
    figure, _ = new_figure(2, 2)
    with pytest.raises(ParameterError, match="png"):
        save_figure(figure, tmp_path / "plot.bmp")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        save_figure(figure, tmp_path / "file" / "plot.png")
    old = tmp_path / "plot.png"
    old.write_text("old")

    def fails(*args, **kwargs):
        args[0].write(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="No space"):
        save_figure(SimpleNamespace(savefig=fails), old)
    assert old.read_text() == "old"
    assert {p.name for p in tmp_path.iterdir()} == {"file", "plot.png"}


def test_the_same_plot_is_the_same_file(comparison, tmp_path):
    one, other = tmp_path / "1.svg", tmp_path / "2.svg"
    comparison_plot(comparison, one)
    comparison_plot(comparison, other)
    assert one.read_bytes() == other.read_bytes()


def test_the_users_style_is_left_alone(comparison):
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    comparison_plot(comparison)
    assert dict(mpl.rcParams) == before


def test_matplotlib_is_imported_late():
    code = "import sys, pamid.plots, pamid.compare, pamid.cli; assert 'matplotlib' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def seen_by(colour: str, kind: str) -> np.ndarray:
    """Linear RGB of a colour as an eye without one kind of cone sees it (Machado 2009, 10.1109/TVCG.2009.113)."""
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    matrices = {
        "normal": np.eye(3),
        "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    }
    return np.asarray(matrices[kind]) @ linear


@pytest.mark.parametrize("kind", ["normal", "protan", "deutan", "tritan"])
def test_colours_are_told_apart_by_every_eye(kind):
    palette = [seen_by(c, kind) for c in (BLUE, ORANGE, GREEN, PURPLE, SKY)]
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(palette) for b in palette[:i]]
    assert min(gaps) > 0.1
    assert np.linalg.norm(seen_by(BLUE, kind) - seen_by(GREY, kind)) > 0.1
