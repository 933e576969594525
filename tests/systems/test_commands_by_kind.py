"""A log may be of a bench, a single muscle, a cylinder or a driven joint: each command works or says why not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pamid.bench import BenchParameters, simulate
from pamid.bench.references import sine, triangle
from pamid.cli import app, main
from pamid.opinion.passport import Entry, Passport
from pamid.signals import write_log

KINDS = ("bench", "muscle", "cylinder", "joint")
QUICK = {
    "bench": "coulomb_friction", "muscle": "slack,force_bias", "cylinder": "coulomb_friction,force_bias",
    "joint": "viscous_friction,coulomb_friction",
}  # fmt: skip
MODELS = "GeometricForce(chou_hannaford),PolynomialForce(area)"
WORKS = ("check", "evaluate", "resid", "compare", "fit", "present", "export", "diagnose", "next", "init")
"""Commands that take every kind."""
SAYS = {
    "adapt": (("cylinder", "joint"), "fit CylinderForce|fit JointDrive"),
    "simulate": (("muscle", "cylinder", "joint"), "a simulator file of the bench"),
    "passport": (("bench",), "that of a bench"),
}
"""Commands for some kinds alone: those that they are not for, and the words in which they say so."""
WITHOUT = ("completion", "demo", "watch")
"""Commands without a log; a stream is watched in tests/online."""

pytestmark = pytest.mark.filterwarnings("ignore::pamid.errors.PamidWarning")


@pytest.fixture
def every(files) -> Path:
    """A log and a page of each kind, the bench among them."""
    params = BenchParameters.for_muscle("B").replace(effects=(("coulomb_friction", {"amplitude": 8.0}),))
    log = simulate(params, [sine(4, 15, 900), triangle(4, 20, 900), sine(8, 10, 900)], seed=0)
    write_log(log, files / "bench.csv")
    params.replace(effects=()).to_toml(files / "bench.toml")
    return files


def arguments(folder: Path, kind: str) -> list[str]:
    return [str(folder / f"{kind}.csv"), "--sim", str(folder / f"{kind}.toml")]


def test_every_command_is_known_for_every_kind():
    names = {module.__name__.rpartition(".")[2] for module in app.commands()}
    assert names == {*WORKS, *SAYS, *WITHOUT}


def test_the_readme_names_the_commands_for_some_kinds():
    page = Path(__file__).resolve().parents[2] / "README.md"
    if not page.is_file():
        pytest.skip("needs the repository")
    items = page.read_text(encoding="utf-8").split("\n- ")
    (item,) = (text for text in items if text.startswith("`pamid passport`"))
    assert item.count("`") == 2 * len(SAYS) and all(f"`pamid {name}`" in item for name in SAYS)


@pytest.mark.parametrize("kind", KINDS)
def test_commands_that_take_every_kind(kind, every, capsys):
    log, out = arguments(every, kind), every / "out"

    def told(*argv: str) -> dict:
        assert main([*argv, "--json", "--quiet"]) == 0
        return json.loads(capsys.readouterr().out)

    assert told("check", *log)["sampling"]["runs"] == 3
    assert told("evaluate", *log)["equations"]
    assert told("resid", *log, "--lags", "10")["equations"]
    chosen = MODELS if kind in ("bench", "muscle") else "nominal*,quadratic"
    assert len(told("compare", *log, "--estimators", chosen, "--folds", "3")["estimators"]) > 1
    model = str(every / "model.pamid")
    fitted = told("fit", *log, "--out", model)
    assert fitted["held_out"]["rmse"] > 0
    for name, number in fitted["parameters"].items():
        assert number["unit"], name
        assert number["standard_error"] is not None or not number["fitted"], name
    assert told("evaluate", *log, "--model", model)["rmse"] == pytest.approx(fitted["training"]["rmse"])
    assert told("resid", *log, "--lags", "10", "--model", model)["equations"]
    assert told("present", model)["parameters"] == fitted["parameters"]
    assert told("export", model, "--out", str(out / "c"))["outputs"]
    found = told("diagnose", *log, "--out", str(out / "gap"), "--effects", QUICK[kind])
    assert found["verdict"] in ("cause", "class", "several", "unknown", "none")
    assert (out / "gap" / "corrected.toml").is_file()
    plan = told("next", str(out / "gap"), "--designs", "8")
    assert plan["purpose"] in ("discriminate", "parameters", "unseen", "none")
    assert not plan["runs"] or (out / "gap" / "next" / "set_points.csv").is_file()


@pytest.mark.parametrize("kind", KINDS)
def test_init_writes_the_page_of_every_kind(kind, every, capsys):
    sizes = {
        "cylinder": ["--set", "bore=25 mm"],
        "muscle": ["--set", "rest_length=200 mm", "--set", "rest_diameter=20 mm"],
    }
    argv = ["init", str(every / f"{kind}.csv"), "--kind", kind, *sizes.get(kind, []), "--yes", "--out"]
    assert main([*argv, str(every / "new"), "--json"]) == 0, capsys.readouterr().err
    written = json.loads(capsys.readouterr().out)
    assert written["kind"] == kind
    page = ["--columns", written["files"]["columns.toml"], "--sim", written["files"]["sim.toml"]]
    assert main(["check", str(every / f"{kind}.csv"), *page, "--quiet"]) == 0


@pytest.mark.parametrize(("command", "kind"), [(c, k) for c, (kinds, _) in SAYS.items() for k in kinds])
def test_commands_that_are_for_some_kinds_say_so(command, kind, every, capsys):
    log, model = arguments(every, kind), str(every / "model.pamid")
    if command == "adapt":
        assert main(["fit", *log, "--folds", "0", "--out", model]) == 0
    (every / "passport.toml").write_text(Passport({"m": Entry(2.0, 1.98, 2.02, "kg", "holds", 2.01)}).text())
    capsys.readouterr()
    argv = {
        "adapt": [model, *log, "--out", str(every / "adapted.pamid")],
        "simulate": [*log[1:], "--trajectory", "sine:frequency=4,amplitude=5", "--out", str(every / "new.csv")],
        "passport": [str(every / "passport.toml"), *log],
    }[command]
    assert main([command, *argv]) == 2
    said = capsys.readouterr().err
    assert any(words in said for words in SAYS[command][1].split("|")), said
