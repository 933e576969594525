"""The pictures of a diagnosis, and its display."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pamid.errors import ParameterError, UnknownOptionError
from pamid.gap.diagnosis.findings import (
    Cause,
)
from pamid.report import GapDisplay, answers, report_html
from pamid.report.drawings.closure import closure_figure, waterfall
from pamid.report.drawings.course import course_figure, fit, shared_limits
from pamid.report.drawings.loops import loop_figure
from pamid.report.drawings.maps import bounds, map_figure
from pamid.report.drawings.ranking import ranking_figure
from pamid.report.drawings.spectrum import spectrum_figure, worse_bands
from pamid.report.drawings.windows import telling_trajectories
from pamid.report.words import BENCH


# --- pictures -----------------------------------------------------------------------------------------------
def axis_labels(figure) -> list[str]:
    texts = [t for ax in figure.axes for t in (ax.get_xlabel(), ax.get_ylabel())]
    return [t for t in (*texts, figure.get_supxlabel()) if t]


@pytest.mark.parametrize("equation", ["force", "flow", "valve", "joint"])
def test_pictures_of_every_equation_have_units(diagnoses, equation):
    d = diagnoses["cause"]
    unit = {"force": "N", "flow": "mg/s", "valve": "mg/s", "joint": "N m"}[equation]
    for figure in (map_figure(d, equation), loop_figure(d, equation), spectrum_figure(d, equation)):
        labels = axis_labels(figure)
        assert any(unit in label for label in labels)
        plain = [label for label in labels if "/" not in label]
        assert all(label in ("valve command", "") for label in plain), plain


def test_a_map_shows_the_sign_of_friction_before_and_nothing_after(diagnoses):
    figure = map_figure(diagnoses["cause"], "force", "eps", "deps")
    before, after = (ax.collections[0].get_array() for ax in figure.axes[:2])
    rate = np.linspace(*figure.axes[0].get_ylim(), before.shape[0])
    moving = np.abs(rate) > 3
    below, above = before[moving & (rate < 0)], before[moving & (rate > 0)]
    assert below.mean() > 4 > -4 > above.mean(), "friction works against the motion"
    assert np.abs(after).max() < 0.5
    assert [len(ax.patches) for ax in figure.axes[:2]] == [1, 1], "the region is framed"
    assert len(map_figure(diagnoses["unknown"]).axes) == 2, "one map and its scale where nothing was added"


def test_bounds_of_a_query():
    assert bounds("eps1 > 0.1 and eps1 <= 0.2 and deps1 < 0") == {"eps": (0.1, 0.2), "deps": (-np.inf, 0.0)}
    assert bounds("abs(eps1) > 1") == {}


def test_a_map_refuses_what_is_not_there(diagnoses):
    with pytest.raises(ParameterError, match="nonsense"):
        map_figure(diagnoses["cause"], "force", "nonsense", "eps")
    with pytest.raises(UnknownOptionError, match="one of force"):
        map_figure(diagnoses["cause"], "heat")
    with pytest.raises(UnknownOptionError, match="no run"):
        loop_figure(diagnoses["cause"], "force", "nonsense")


def test_the_spectrum_agrees_with_the_mean_square(diagnoses):
    d = diagnoses["cause"]
    line = {li.get_label(): li for li in spectrum_figure(d, "force").axes[0].lines}
    frequency, density = line["before"].get_xdata(), line["before"].get_ydata()
    part = d.windows[d.windows["equation"] == "force"]
    fluctuation = part["before"] ** 2
    assert np.sum(density**2) * (frequency[1] - frequency[0]) == pytest.approx(fluctuation.mean(), rel=0.5)
    assert set(line) == {"before", "after", "noise"}
    assert line["after"].get_ydata().max() < 0.1 * density.max()


def test_a_band_in_which_the_causes_do_harm_is_told(diagnoses):
    d = diagnoses["cause"]
    assert worse_bands(d, "force") == []
    time = d.windows["time"].to_numpy()
    shaken = d.windows["after"] + 2.0 * np.sin(2 * np.pi * 9.0 * time)
    worse = replace(d, windows=d.windows.assign(after=shaken))
    [(low, high, factor)] = worse_bands(worse, "force")
    assert low <= 9.0 <= high and factor > 1.5
    assert "the error is larger from" in report_html(worse)
    assert "the error is larger from" not in report_html(d)


def test_measured_and_simulated_stand_on_one_scale(diagnoses):
    d = diagnoses["cause"]
    runs = telling_trajectories(d, "force", 2)
    limits = shared_limits(d, "force", runs)
    for run in runs:
        figure = course_figure(d, "force", run, limits)
        assert figure.axes[0].get_ylim() == limits
        assert figure.axes[0].get_ylabel() == "force / N"
    part = d.windows[(d.windows["equation"] == "force") & (d.windows["trajectory"].astype(str) == runs[0])]
    assert fit(part, "after") > fit(part, "before")
    error = np.sqrt(np.mean(part["before"] ** 2)) / np.std(part["measured"])
    assert fit(part, "before") == pytest.approx(100 * (1 - error))
    assert BENCH.target("torque", "V").label == "drive / V" and BENCH.target("torque", "N m").label == "torque / N m"


def test_the_waterfall_adds_up(diagnoses):
    d = diagnoses["several"]
    bars = waterfall(d, d.closure[0])
    assert bars[0].end == 1.0
    assert bars[1].end == pytest.approx(bars[2].end) == pytest.approx((1.43 / 5.82) ** 2)
    assert bars[3].start == bars[2].end  # what no cause explains lies between what is left and its noise
    assert bars[3].end == bars[4].end == pytest.approx((0.62 / 5.82) ** 2)
    shared = replace(d, causes=[replace(c, equation="force") for c in d.causes])
    falls = [b.start - b.end for b in waterfall(shared, d.closure[0])[1:3]]
    assert falls[0] / falls[1] == pytest.approx(0.62 / 0.31)
    assert sum(falls) == pytest.approx(1 - (1.43 / 5.82) ** 2)
    assert "%" in axis_labels(closure_figure(d))[0]


def test_the_ranking_marks_the_answer(diagnoses):
    from pamid.plots.style import BLUE, GREY

    ax = ranking_figure(diagnoses["class"], most=5).axes[0]
    names = [t.get_text() for t in ax.get_yticklabels()]
    assert names[:2] == ["Coulomb friction", "hysteresis"]
    from matplotlib.colors import to_hex

    assert [to_hex(p.get_facecolor()).upper() for p in ax.patches] == [BLUE, BLUE] + [GREY] * 3


@pytest.mark.parametrize("kind", ["map", "course", "loop", "ranking", "spectrum", "closure"])
def test_display_draws_every_kind(diagnoses, kind):
    display = GapDisplay.from_diagnosis(diagnoses["cause"]).plot(kind)
    assert display.axes_
    assert display._repr_html_().startswith("<svg")


def test_display_speaks_and_refuses(diagnoses):
    display = GapDisplay.from_diagnosis(diagnoses["cause"])
    assert "One cause: Coulomb friction" in repr(display)
    assert "<dt>" in display._repr_html_()
    with pytest.raises(UnknownOptionError, match="map, course"):
        display.plot("pie")
    with pytest.raises(ParameterError, match="diagnosis_"):
        GapDisplay.from_estimator(object())
    holder = type("Fitted", (), {"diagnosis_": diagnoses["none"]})()
    assert GapDisplay.from_estimator(holder).diagnosis is diagnoses["none"]


def test_the_old_name_of_what_distinguishes_serves_one_version() -> None:
    cause = Cause(("gas_temperature", "dead_volume"), "flow", 0.9, 1.0, (0.9, 1.0), {}, distinguished_by="isobaric")
    with pytest.warns(FutureWarning, match="distinguished_by"):
        assert cause.told_apart_by == "isobaric"


@pytest.mark.parametrize("verdict", ["cause", "class", "several", "unknown", "none"])
def test_a_printed_diagnosis_is_its_sentences(diagnoses, verdict):
    d = diagnoses[verdict]
    assert str(d) == str(answers(d))
    assert len(str(d).splitlines()) <= 4  # the verdict, then where, which and how far
    assert len(repr(d)) < 100 and verdict in repr(d)
