"""Plots: what they show, with units, and how they reach a file."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GeometricForce, PolynomialFlow, SINDyRegressor
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.frozen import FrozenEstimator

from pamid.compare.comparison import Comparison, Score
from pamid.errors import (
    ExcitationError,
    IncompatibleError,
    MissingColumnError,
    MissingTrajectoryError,
    OutputError,
    ParameterError,
    ShapeError,
    UnknownOptionError,
)
from pamid.plots import (
    AdaptationDisplay,
    ForceMapDisplay,
    LoopDisplay,
    ResidualMapDisplay,
    VolumeDisplay,
    VolumeSurfaceDisplay,
    comparison_plot,
    fit_plot,
    save_figure,
    volume_plot,
)
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


def test_no_volume_is_drawn_over_a_contraction_that_stands_still(fitted, data):
    with pytest.raises(ExcitationError, match="stays between 12 and 12 %"):
        VolumeDisplay.from_estimator(fitted, data[0].assign(eps=0.12))
    slope = volume_plot(fitted, data[0], level=False)
    assert [ax.get_ylabel() for ax in slope.axes] == ["slope of the volume, ∂V/∂ε / cm³"]


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


# --- displays of estimators and of predictions ------------------------------------------------------------------
@pytest.fixture
def runs(data):
    X, force = data
    names = np.repeat(["sine-1", "sine-2", "step-1"], 100)
    return X.assign(trajectory=names), force, names


@pytest.fixture(autouse=True)
def no_window(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


def test_loops_of_runs(fitted, runs):
    X, force, names = runs
    display = LoopDisplay.from_estimator(fitted, X.drop(columns="trajectory"), force + 5, groups=names).plot()
    assert labels(display.figure_)[:2] == ["contraction / %", "force / N"]
    wide, narrow = display.ax_.lines[:2]
    assert np.mean(wide.get_ydata() - narrow.get_ydata()) == pytest.approx(5, abs=0.5)
    again = LoopDisplay.from_predictions(1e-6 * force, 1e-6 * force, X, across="P", unit="kg/s").plot(runs=["step-1"])
    assert labels(again.figure_)[:2] == ["pressure, absolute / bar", "mass flow / mg/s"]
    assert np.ptp(again.ax_.lines[0].get_ydata()) == pytest.approx(np.ptp(force[200:]))
    with pytest.raises(UnknownOptionError, match="sine-9"):
        display.plot(runs=["sine-9"])
    with pytest.raises(MissingTrajectoryError):
        LoopDisplay.from_predictions(force, force, X.drop(columns="trajectory"))
    with pytest.raises(ShapeError):
        LoopDisplay.from_predictions(force[:5], force, X)


def test_a_residual_map_shows_where_and_which_way(fitted, runs):
    X, force, _ = runs
    bump = 30.0 * (X["eps"] > 0.1) * (X["P"] > 4e5)
    display = ResidualMapDisplay.from_estimator(fitted, X, force + bump, cells=(4, 4)).plot()
    assert display.residual[3, 3] == pytest.approx(30, abs=3)
    assert display.residual[0, 0] == pytest.approx(0, abs=3)
    assert labels(display.figure_)[:2] == ["contraction / %", "pressure, absolute / bar"]
    assert any("measured less predicted / N" in text for text in labels(display.figure_))
    mesh = display.ax_.collections[0]
    assert mesh.get_clim()[0] == -mesh.get_clim()[1]
    still = ResidualMapDisplay.from_predictions(force, force, X.assign(eps=0.1)).plot()
    assert np.isfinite(still.ax_.get_xlim()).all()
    with pytest.raises(MissingColumnError, match="deps"):
        ResidualMapDisplay.from_predictions(force, force, X, over=("eps", "deps"))
    with pytest.raises(ParameterError):
        ResidualMapDisplay.from_predictions(force, force, X, cells=(1, 4))


def test_a_volume_surface_knows_how_far_it_is_known(fitted, runs):
    X, force, names = runs
    noisy = force + 20 * np.random.default_rng(0).standard_normal(len(force))
    plain = X.drop(columns="trajectory")
    model = GeometricForce(rest_length=0.2, rest_diameter=0.02)
    display = VolumeSurfaceDisplay.from_estimator(model, plain, noisy, groups=names, n_refits=4, random_state=0).plot()
    calm = VolumeSurfaceDisplay.from_estimator(model, plain, force, groups=names, n_refits=4, random_state=0)
    assert display.V_std.mean() > 10 * calm.V_std.mean()
    assert not hasattr(model, "coef_")
    assert labels(display.figure_) == ["contraction / %", "gauge pressure / bar", "volume V / cm³"]
    corner = VolumeSurfaceDisplay.from_estimators([fitted], plain[(plain["eps"] < 0.1) | (plain["P"] < 4e5)])
    assert not corner.known[-5:, -5:].any()
    assert corner.known[:5, :5].all()
    assert np.all(corner.plot().V_std == 0)
    given = VolumeSurfaceDisplay.from_predictions(corner.eps, corner.p_gauge, corner.V, 0.02 * corner.V).plot()
    assert given.known.all()
    with pytest.raises(ParameterError, match="1 runs"):
        VolumeSurfaceDisplay.from_estimator(model, plain, force, groups=np.repeat("a", 300))
    with pytest.raises(IncompatibleError):
        VolumeSurfaceDisplay.from_estimators([SINDyRegressor()], plain)


class Scaled(RegressorMixin, BaseEstimator):
    """Learns one factor on a source; the more samples, the nearer."""

    def __init__(self, source=None):
        self.source = source

    def fit(self, X, y, groups=None):
        base = self.source.predict(X)
        self.factor_ = float(base @ y / (base @ base))
        return self

    def predict(self, X):
        return self.factor_ * self.source.predict(X)


def test_adaptation_curves(fitted, runs):
    X, force, names = runs
    plain, target = X.drop(columns="trajectory"), 1.5 * force + 30 * np.random.default_rng(0).standard_normal(300)
    display = AdaptationDisplay.from_estimator(
        {"factor": Scaled(FrozenEstimator(fitted))},
        plain[:200],
        target[:200],
        plain[200:],
        1.5 * force[200:],
        groups=names[:200],
        samples=(5, 50, 200),
        n_draws=4,
        source=fitted,
        random_state=0,
    ).plot()
    errors = display.errors["factor"]
    assert errors.shape == (3, 4)
    assert errors[0].mean() > errors[2].mean()
    assert display.before > errors.max()
    assert labels(display.figure_) == ["samples of the target", "error of the force on unseen runs, RMSE / N"]
    assert [t.get_text() for t in display.ax_.get_legend().get_texts()] == ["factor", "source as it is"]
    with pytest.raises(ParameterError, match="500 samples"):
        AdaptationDisplay.from_estimator(Scaled(fitted), plain, target, plain, target, groups=names, samples=[500])
    with pytest.raises(ShapeError):
        AdaptationDisplay.from_predictions([1, 2], {"a": [1.0]})


def test_displays_draw_on_the_axes_they_are_given(fitted, runs):
    X, force, _ = runs
    _, axes = new_figure(9, 3, 1, 3)
    surface = VolumeSurfaceDisplay.from_estimators([fitted], X)
    for ax, display in zip(
        axes[0],
        (LoopDisplay.from_predictions(force, force, X), ResidualMapDisplay.from_predictions(force, force, X), surface),
        strict=True,
    ):
        assert display.plot(ax).ax_ is ax
    taken = ForceMapDisplay.from_predictions([0.0, 0.1], [0.0, 1e5], [[1.0, 2.0], [3.0, 4.0]]).plot()
    assert "force at rest / N" in labels(taken.figure_)
