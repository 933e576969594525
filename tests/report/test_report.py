"""The report of a diagnosis: its sentences, its pictures, its page; what it shows, and that text stays text."""

from __future__ import annotations

import html.parser
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate
from pamid.bench.references import sine, step, triangle
from pamid.equations import all_equations, residuals
from pamid.errors import OutputError, ParameterError, UnknownOptionError
from pamid.gap.diagnosis.findings import (
    Band,
    Candidate,
    Cause,
    Closure,
    EquationFinding,
    NextExperiment,
    ParameterEstimate,
    Region,
    TrajectoryShare,
)
from pamid.gap.diagnosis.result import Diagnosis
from pamid.report import GapDisplay, answers, report_html, write_report
from pamid.report.drawings.closure import closure_figure, waterfall
from pamid.report.drawings.course import course_figure, fit, shared_limits
from pamid.report.drawings.loops import loop_figure
from pamid.report.drawings.maps import bounds, map_figure
from pamid.report.drawings.ranking import ranking_figure
from pamid.report.drawings.spectrum import spectrum_figure, worse_bands
from pamid.report.drawings.windows import telling_trajectories
from pamid.report.quantities import amount, percent, share_span, span, target
from pamid.report.sections import Source, all_sections
from pamid.report.sentences import query_words
from pamid.systems.cylinder import Cylinder

TRUE = ("coulomb_friction", {"amplitude": 6.0, "presliding": 5e-4})
VERDICTS = ("cause", "class", "several", "unknown", "none")


def windows_of(log: pd.DataFrame, nominal: BenchParameters, corrected: BenchParameters) -> pd.DataFrame:
    """The table that a diagnosis keeps: residuals of both simulators with the state at each window."""
    gain = nominal.joint.pulley_radius / nominal.muscle.rest_length
    runs = dict(iter(log.groupby("trajectory", sort=False)))
    frames = []
    pairs = zip(residuals(log, nominal), residuals(log, corrected), strict=True)
    for (run, name, before), (_, _, after) in pairs:
        rows, time = runs[run], runs[run]["time"].to_numpy()
        kept = np.isin(np.round(before.time, 6), np.round(after.time, 6))
        for k, side in enumerate(all_equations()[name].sides):
            muscle = side if side in "12" else "1"
            eps = nominal.muscle.initial_contraction + gain * rows["q"].to_numpy() * (1 if muscle == "1" else -1)
            P = rows[f"P{muscle}"].to_numpy()
            state = {"eps": eps, "deps": np.gradient(eps, time), "P": P, "dP": np.gradient(P, time)}
            state |= {"u": rows[f"u{muscle}"].to_numpy(), "q": rows["q"].to_numpy()}
            frames.append(
                pd.DataFrame(
                    {
                        "trajectory": run,
                        "time": after.time,
                        "equation": name,
                        "side": side,
                        **{c: np.interp(after.time, time, v) for c, v in state.items()},
                        "measured": before.measured[kept, k],
                        "before": before.value[kept, k],
                        "after": after.value[:, k],
                        "noise": after.noise[:, k],
                    }
                )
            )
    return pd.concat(frames, ignore_index=True)


@pytest.fixture(scope="module")
def material() -> tuple[BenchParameters, BenchParameters, pd.DataFrame]:
    nominal = BenchParameters.for_muscle("B")
    actual = nominal.replace(effects=(TRUE,))
    runs = [sine(4, 15, 1800), sine(10, 8, 1000), triangle(4, 20, 1600), step(0, 12, 1000)]
    log = simulate(actual, runs, seed=0)
    return nominal, actual, windows_of(log, nominal, actual)


def diagnosis_of(verdict: str, material: tuple[BenchParameters, BenchParameters, pd.DataFrame]) -> Diagnosis:
    nominal, corrected, windows = material
    friction = Cause(
        ("coulomb_friction",),
        "force",
        0.93,
        0.95,
        (0.92, 0.97),
        {
            "amplitude": ParameterEstimate(5.94, "N", (5.7, 6.2)),
            "presliding": ParameterEstimate(4.8e-4, "-", (2.1e-4, np.inf)),
        },
    )
    gas = Cause(
        ("leakage",),
        "flow",
        0.88,
        0.31,
        (0.22, 0.40),
        {"conductance": ParameterEstimate(2.1e-10, "m^3/(s Pa)", (1.9e-10, 2.4e-10))},
    )
    causes = {
        "cause": [friction],
        "class": [
            replace(
                friction,
                effects=("coulomb_friction", "hysteresis"),
                distinguished_by="a triangle of small amplitude within the presliding range",
            )
        ],
        "several": [replace(friction, share=0.62, share_ci90=(0.55, 0.70)), gas],
        "unknown": [],
        "none": [],
    }[verdict]
    told = {name for c in causes for name in c.effects} or {verdict}
    library = {
        "coulomb_friction": (410.0, 0.95), "hysteresis": (402.0, 0.90), "stribeck_friction": (350.0, 0.82),
        "viscous_friction": (120.0, 0.31), "leakage": (90.0, 0.24), "creep": (20.0, 0.05), "force_lag": (15.0, 0.04),
        "dead_volume": (1.0, 0.01), "bladder_elasticity": (-2.0, 0.0), "none": (0.0, 0.0), "unknown": (3.0, 0.0),
    }  # fmt: skip
    candidates = [
        Candidate(
            name,
            0.93 / len(told) if name in told else 0.07 / (len(library) - len(told)),
            score,
            closed,
            "" if name in told else f"closes {100 * closed:.0f} % where the best closes 95 %",
        )
        for name, (score, closed) in library.items()
    ]
    order = {"cause": 0.97, "class": 0.97, "several": 0.63, "unknown": 0.97, "none": 0.25}[verdict]
    equations = [
        EquationFinding("force", order, 1e-4 if verdict != "none" else 0.62, 3.2 if verdict != "none" else 0.04),
        EquationFinding("flow", (1 - order) * 0.9, 0.02 if verdict == "several" else 0.41, 0.2),
        EquationFinding("valve", (1 - order) * 0.1, 0.77, 0.05),
        EquationFinding("joint", 0.0, 0.55, 0.02),
    ]
    none = verdict == "none"
    shares = {"sine-4-15": 0.41, "triangle-4-20": 0.34, "sine-10-8": 0.2, "step-0-12": 0.05}
    return Diagnosis(
        verdict=verdict,
        p_value=0.41 if none else 0.0005,
        equations=equations,
        regions=[] if none else [Region("force", "eps1 > 0.138 and deps1 > 0", 0.61, 0.17)],
        bands=[] if none else [Band("force", 0, 2, 0.83), Band("force", 2, 8, 0.14), Band("force", 8, 25, 0.03)],
        trajectories=[] if none else [TrajectoryShare(n, s) for n, s in shares.items()],
        candidates=candidates,
        causes=causes,
        closure=[
            Closure("force", 5.82, 1.43 if causes else 5.82, 0.62, 0.95 if causes else 0.0, (0.92, 0.97), "N"),
            Closure("flow", 4.1e-6, 3.9e-6, 3.8e-6, 0.31 if causes else 0.0, (0.1, 0.5), "kg/s"),
            Closure("joint", 0.21, 0.2, 0.2, 0.0, (0.0, 0.3), "N m"),
        ],
        next_experiment=None
        if verdict in ("cause", "none")
        else NextExperiment(
            {"kind": "triangle", "frequency": 0.5, "amplitude": 4, "seconds": 20},
            ("coulomb_friction", "hysteresis"),
            5.0,
            "Nested reversals show whether the force remembers more than the last one.",
        ),
        notes=["The noise floor rests on the samples' own scatter, since no run is repeated."],
        nominal=nominal,
        corrected=corrected if causes else nominal,
        windows=windows if not none else windows.assign(before=windows["after"]),
        leftover={"depends_on": ["eps", "deps"], "form": "-0.8 eps^2 - 3.1 deps", "predictable_share": 0.72}
        if verdict == "unknown"
        else {},
    )


def with_offset(d: Diagnosis, unit: str, value: float, corrected: Any) -> Diagnosis:
    offset = {"offset": ParameterEstimate(value, unit, (0.99 * value, 1.01 * value))}
    return replace(d, causes=[replace(d.causes[0], parameters=offset)], corrected=corrected)


def test_an_offset_of_the_ambient_pressure_is_asked_about_first(material) -> None:
    d = diagnosis_of("cause", material)
    assert not answers(d).where.startswith("Is ")
    for value, asked in ((101_325.0, True), (-95_000.0, True), (60_000.0, False), (120_000.0, False)):
        assert answers(with_offset(d, "Pa", value, d.corrected)).where.startswith("Is gauge pressure") == asked
    cylinder = Cylinder(bore=0.025)  # 491 mm²: 49.7 N
    for off, asked in ((49.7, True), (-47.0, True), (30.0, False)):
        said = answers(replace(d, corrected=cylinder, windows=d.windows.assign(before=off))).where
        assert said.startswith("Is gauge pressure") == asked
        assert ("the ambient pressure on 490.9 mm²" in said) == asked


def test_a_gain_of_a_power_of_ten_is_asked_about_first(material) -> None:
    d = diagnosis_of("cause", material)
    simulated = 300.0 + 30.0 * np.sin(np.arange(len(d.windows)) / 5.0)
    for gain, asked in ((0.1, True), (1 / 9.80665, True), (10.0, True), (1e3, True), (1.0, False), (3.0, False)):
        windows = d.windows.assign(measured=gain * simulated, before=(gain - 1.0) * simulated, equation="force")
        assert answers(replace(d, windows=windows)).where.startswith("Is a unit wrong?") == asked, gain


@pytest.fixture(scope="module")
def diagnoses(material) -> dict[str, Diagnosis]:
    return {verdict: diagnosis_of(verdict, material) for verdict in VERDICTS}


@pytest.fixture(scope="module")
def pages(diagnoses) -> dict[str, str]:
    source = Source("logs/data.parquet", "logs/sim.toml", 5400, 4)
    return {verdict: report_html(d, source) for verdict, d in diagnoses.items()}


# --- sentences ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("cause", ("One cause: Coulomb friction", "97 % of the gap lies in the force equation", "5.94 N",
                   "5.7 to 6.2 N", "closes 95 % (90 % interval 92 to 97 %)", "5.82 N becomes 1.43 N", "below 2 Hz")),
        ("class", ("cannot tell which: Coulomb friction or hysteresis", "93 % that it is one of them",
                   "a triangle of small amplitude")),
        ("several", ("Two causes: Coulomb friction and leakage", "force (63 %) and flow (33 %)", "88 % or more")),
        ("unknown", ("not in the library", "the best, Coulomb friction, closes 95 %",
                     "depends on contraction and contraction rate", "Nothing is added")),
        ("none", ("No gap", "Nowhere: force, flow, valve and joint agree", "p = 0.41", "nothing to close")),
    ],
)  # fmt: skip
def test_a_verdict_reads_as_sentences(diagnoses, verdict, words):
    told = answers(diagnoses[verdict])
    text = " ".join(told)
    assert [w for w in words if w not in text] == []
    for sentence in told[1:]:
        assert sentence.endswith(".")
        assert not re.search(r"nan|inf\b|_|\{|\}|  |\.\.", sentence), sentence


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("eps1 > 0.168 and deps1 > 0",
         "where the contraction is above 16.8 % and the muscle shortens"),
        ("(P2 <= 250000.0)", "where the pressure of muscle 2 is below 2.5 bar"),
        ("u1 < 0 and dP1 < 0", "where the muscle is being vented and the muscle loses pressure"),
        ("time > 1.5", "where the time is above 1.5 s"),
        ("deps1 < -0.05", "where the contraction rate is below -5 %/s"),
        ("abs(q) > 0.1", "where abs(q) > 0.1"),
    ],
)  # fmt: skip
def test_a_query_reads_as_words(query, words):
    assert query_words(query) == words


def test_intervals_that_data_do_not_bound_are_said_to_be_open():
    assert span(1.0, np.inf, "N") == "from 1 N, no upper bound"
    assert span(-np.inf, np.inf, "N") == "not bounded by this log"
    assert span(1e-6, 2e-6, "kg/s") == "1 to 2 mg/s"
    assert span(5.998, 6.003, "N") == "5.998 to 6.003 N"
    assert [share_span(*e) for e in ((1.0, 1.0), (0.9996, 0.9999), (0.991, 0.993), (0.9, 1.0))] == [
        "100 %", "over 99.9 %", "99.1 to 99.3 %", "90 to 100 %",
    ]  # fmt: skip
    assert amount(np.nan, "N") == "unknown"
    assert [percent(s) for s in (0.0, 0.001, 0.5, 0.999, 1.0)] == ["0 %", "under 1 %", "50 %", "over 99 %", "100 %"]


def test_sentences_survive_a_diagnosis_with_nothing_in_it(diagnoses):
    bare = replace(
        diagnoses["cause"], equations=[], regions=[], bands=[], trajectories=[], candidates=[], closure=[], notes=[],
        windows=diagnoses["cause"].windows.iloc[:0],
    )  # fmt: skip
    for verdict in VERDICTS:
        d = replace(bare, verdict=verdict, causes=diagnoses[verdict].causes, p_value=np.nan)
        assert all(answers(d))
        d = replace(d, nominal=None, corrected=None)  # as of a model that is no bench
        assert "<h1>" in report_html(d)


# --- the page -----------------------------------------------------------------------------------------------
class Reader(html.parser.HTMLParser):
    """Collects what a page asks for and whether its tags close."""

    VOID = ("meta", "br", "path", "use", "image", "rect", "line", "link", "img")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.text: list[str] = []
        self.charts: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for key, value in attrs:
            if key == "id":
                self.ids.append(value)
            if key in ("href", "src", "xlink:href", "action", "srcset", "poster", "data"):
                self.links.append(value)
            if key == "aria-label" and tag == "svg":
                self.charts.append(value)
            assert not key.startswith("on"), key

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert not reader.open
    return reader


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_is_whole_and_asks_for_nothing(pages, diagnoses, verdict):
    page = pages[verdict]
    reader = read(page)
    assert "script" not in reader.tags
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in reader.links)
    assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", re.sub(r"base64,[\w+/=\s]+", "", page))
    assert len(reader.ids) == len(set(reader.ids))
    targets = {link[1:] for link in reader.links if link.startswith("#")}
    assert targets <= set(reader.ids), "a link that leads nowhere"
    text = " ".join("".join(reader.text).replace("\u00a0", " ").split())
    told = answers(diagnoses[verdict])
    assert told.verdict in text
    assert told.how_far in text
    assert reader.charts
    assert all(reader.charts)
    assert "nan" not in text.lower().split()
    assert 'content="width=device-width' in page
    assert 'lang="en"' in page
    assert page.count('tabindex="0"') == page.count('class="table"'), "what scrolls is reached by keys"


def test_the_page_holds_what_was_asked_for(pages):
    text = "".join(read(pages["class"]).text).replace("\u00a0", " ")
    for word in (
        "Where the gap lies", "eps1 > 0.138 and deps1 > 0", "triangle-4-20", "What to record next", "hysteresis",
        "more that were ruled out", "closes 31 % where the best closes 95 %", "presliding", "no upper bound",
        "The noise floor rests on", "0 to 2", "logs/sim.toml",
    ):  # fmt: skip
        assert word in text, word
    shown = {name for name in re.findall(r'<section id="([\w-]+)"', pages["class"])}
    # Rounds and days are shown where there are several logs.
    assert shown == {s.name for s in all_sections()} - {"logs", "rounds"}
    assert "next" not in re.findall(r'<section id="([\w-]+)"', pages["cause"])


HOSTILE = "<script>alert(1)</script>\"'&$\\frac{x$</svg><!-- --> {{ 7 * 7 }} \u202e"


def test_text_from_logs_and_files_stays_text(diagnoses):
    d = diagnoses["unknown"]
    windows = d.windows.assign(trajectory=d.windows["trajectory"].replace("sine-4-15", HOSTILE))
    bad = replace(
        d,
        windows=windows,
        trajectories=[TrajectoryShare(HOSTILE, 0.9)],
        regions=[Region("force", HOSTILE, 0.9, 0.1)],
        candidates=[replace(d.candidates[0], ruled_out=HOSTILE), *d.candidates[1:]],
        notes=[HOSTILE],
        leftover={"form": HOSTILE, "depends_on": [HOSTILE]},
        next_experiment=NextExperiment({"kind": HOSTILE, "angle": HOSTILE}, (HOSTILE, "b"), 1.0, HOSTILE),
    )
    page = report_html(bad, Source(HOSTILE, HOSTILE, 1, 1, HOSTILE))
    reader = read(page)
    assert "script" not in reader.tags
    text = "".join(reader.text)
    assert text.count("<script>alert(1)</script>") >= 8
    assert "{{ 7 * 7 }}" in text
    assert "49" not in re.findall(r"\{\{.*?\}\}|\b49\b", text)
    assert "<script" not in page
    shown = GapDisplay(bad)._repr_html_()
    assert "<script" not in shown


def test_the_page_is_the_same_each_time(diagnoses, pages):
    assert report_html(diagnoses["none"], Source("logs/data.parquet", "logs/sim.toml", 5400, 4)) == pages["none"]


def test_a_log_with_few_windows_still_gives_a_page(diagnoses):
    d = diagnoses["cause"]
    few = d.windows.groupby("equation").head(3)
    for windows in (d.windows.iloc[:0], few, few.assign(deps=np.nan, P=np.nan).drop(columns=["u", "dP"])):
        read(report_html(replace(d, windows=windows)))


def test_a_report_is_written_whole_or_not_at_all(diagnoses, tmp_path, monkeypatch):
    bare = replace(diagnoses["none"], windows=diagnoses["none"].windows.iloc[:0])
    target = write_report(bare, tmp_path / "report.html")
    before = target.read_text(encoding="utf-8")
    with pytest.raises(OutputError, match="cannot be written"):
        write_report(bare, tmp_path / "nowhere" / "report.html")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(OutputError, match="No space left"):
        write_report(replace(bare, verdict="unknown"), target)
    assert target.read_text(encoding="utf-8") == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


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
    assert target("torque", "V").label == "drive / V" and target("torque", "N m").label == "torque / N m"


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


def test_a_designed_run_of_a_system_is_said_in_units():
    from pamid.gap import NextExperiment
    from pamid.report.sentences import experiment

    motion = {"kind": "run", "seconds": 80.0, "x": 0.03, "P": 3e5, "P_amplitude": 1e4, "P_frequency": 0.5}
    text = experiment(NextExperiment(motion, ("creep", "directional_friction and maxwell"), 12.0))
    assert "(80 s, stroke held at 30 mm, pressure, absolute 3 bar ± 0.1 bar at 0.5 rad/s)" in text
    assert "tells creep from directional friction and Maxwell" in text
