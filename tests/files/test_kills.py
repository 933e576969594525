"""Commands that are killed at any step, or that find no room: the old files stay, or the new ones are all there."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pamid.estimators import StaticPIHM
from support.killing import TOUCHES, forked, killed_at, killed_in_write, remembered, run, without_room
from support.rail import log_of, rail

import pamid.bench
import pamid.compare
import pamid.report
import pamid.signals
import pamid.survey.page
import pamid.survey.survey
from pamid import any_simulator, load, save
from pamid.bench import BenchParameters, simulate, sine, unfold
from pamid.cli import main
from pamid.cli.app import build_parser
from pamid.cli.commands import demo
from pamid.errors import OutputError
from pamid.file_sets import UNFINISHED, replacing_together
from pamid.files import write_whole
from pamid.gap.design import search
from pamid.opinion import passport
from pamid.opinion.passport import Entry, Passport
from pamid.signals import read_log, write_log
from pamid.simulators import page_text

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system with fork")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
SHORT = ("simulate", "fit", "init")
FMU = ("export-fmu",) if shutil.which("cc") else ()
LONG = (
    "adapt", "export", "export-onnx", *FMU, "diagnose", "check", "check-html", "compare", "next", "passport", "resid"
)  # fmt: skip
WRITES = {
    **{
        name: {"--out"}
        for name in ("adapt", "compare", "demo", "diagnose", "export", "init", "next", "passport", "resid", "simulate")
    },
    "check": {"--html", "--out"},
    "fit": {"--checkpoint", "--out"},
}
"""Options that name an output; checkpoints are killed in test_checkpoint.py, the demo in a test of its own."""
INIT = ["--kind", "muscle", "--yes", "--force"]


# --- what each command writes -------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> Path:
    """Logs and models that the commands read."""
    folder = tmp_path_factory.mktemp("bench")
    nominal = BenchParameters.for_muscle("B")
    nominal.to_toml(folder / "sim.toml")
    runs = [sine(4, 15, 700), sine(9, 8, 700), sine(2, 12, 700)]
    logs = {
        "old": simulate(nominal, runs, effects=["coulomb_friction"], seed=0),
        "new": simulate(nominal, runs, seed=1),
    }
    for name, log in logs.items():
        write_log(log, folder / f"{name}.csv")
    (folder / "rail.toml").write_text(page_text(rail()))
    (folder / "passport.toml").write_text(Passport({"m": Entry(2.0, 1.98, 2.02, "kg", "holds", 2.01)}).text())
    for seed, name in enumerate(logs):
        log_of(1.5, seed=seed).to_csv(folder / f"rail-{name}.csv", index=False)
        rows = unfold(log, nominal)
        columns = {"time": "s", "P": "Pa", "eps": "-", "F": "N"}
        rows.loc[rows["trajectory"] == rows["trajectory"].iloc[0], list(columns)].to_csv(
            folder / f"muscle-{name}.csv", index=False
        )
    return folder


def hybrid(folder: Path, name: str, seed: int) -> int:
    """Fit and save a small hybrid model; torch's threads do not survive a fork, so this must be in one."""
    rows = unfold(read_log(folder / "new.csv"), BenchParameters.from_toml(folder / "sim.toml"))
    X = rows.assign(deps=0.0, dP=0.0)[["eps", "deps", "P", "dP"]]
    model = StaticPIHM(hidden_layer_sizes=(4,), max_iter=1, random_state=seed).fit(X, rows["F"])
    save(model, folder / f"{name}.pamid")
    return 0


@pytest.fixture(scope="module")
def computed(bench, tmp_path_factory) -> Iterator[None]:
    """Compute once what takes long, so that each fork has nothing to do but to write."""
    import torch

    torch.set_num_threads(1)  # its pool of threads would not be there in a fork
    for seed, name in enumerate(("old", "new")):
        assert forked(lambda name=name, seed=seed: hybrid(bench, name, seed)) == 0
    patch = pytest.MonkeyPatch()
    diagnose = any_simulator.diagnose
    once = remembered(lambda log, *rest, **options: diagnose({"log": log}, *rest, **options), whole=True)

    def short(logs, simulator, effects, **options):
        [log] = logs.values()
        return once(log, simulator, ["coulomb_friction"], **options)

    patch.setattr(any_simulator, "diagnose", short)
    for module, name in ((pamid.compare, "compare"), (pamid.survey.survey, "survey"), (passport, "settled")):
        patch.setattr(module, name, remembered(getattr(module, name), whole=True))
    for module, name in ((pamid.report, "report_html"), (pamid.survey.page, "survey_html"), (search, "plan_next")):
        patch.setattr(module, name, remembered(getattr(module, name)))
    for which in ("old", "new"):
        (bench / f"found-{which}").mkdir()
        assert main(command("diagnose", which, bench, bench / f"found-{which}")) == 0
    for name, which in itertools.product(("check", "compare", "next", "passport", "resid"), ("old", "new")):
        assert main(command(name, which, bench, tmp_path_factory.mktemp("first"))) == 0
    yield
    patch.undo()


def command(name: str, which: str, bench: Path, out: Path) -> list[str]:
    """Return the command line that writes the old or the new results to a folder."""
    old, log, sim = which == "old", str(bench / f"{which}.csv"), ["--sim", str(bench / "sim.toml")]
    run = "sine:frequency=4,amplitude=15,seconds=0.2"
    to, model = ["--out", str(out)], str(bench / f"{which}.pamid")
    words = {
        "simulate": ["simulate", "--trajectory", run, "--effect", "leakage" if old else "hysteresis"],
        "fit": ["fit", log, *sim, "--estimator", "GeometricForce"],
        "adapt": ["adapt", str(bench / "new.pamid"), log, *sim, "--method", "scales"],
        "diagnose": ["diagnose", log, *sim, *to],
        "check": ["check", log, *sim, *to],
        "check-html": ["check", log, *sim, "--html", str(out / "check.html")],
        "compare": ["compare", log, *sim, "--equation", "force", "--estimators", "GeometricForce", "--folds", "2", *to],
        "next": ["next", str(bench / f"found-{which}"), "--designs", "8", *to],
        "resid": ["resid", log, *sim, "--lags", "5", "--out", str(out / "resid.svg")],
        "export": ["export", model, *to],
        "export-onnx": ["export", model, "--to", "onnx", *to],
        "export-fmu": ["export", model, "--to", "fmu", *to],
        "passport": [
            "passport",
            str(bench / "passport.toml"),
            str(bench / f"rail-{which}.csv"),
            "--sim",
            str(bench / "rail.toml"),
            *to,
        ],
        "init": ["init", str(bench / f"muscle-{which}.csv"), "--set", f"rest_length=0.{2 if old else 3} m", *INIT, *to],
    }
    file = {"simulate": "log.csv", "fit": "model.pamid", "adapt": "model.pamid"}.get(name)
    return [*words[name], *(["--out", str(out / file)] if file else []), "--quiet"]


def state(folder: Path) -> dict[str, str]:
    """Return the content of each file that a reader sees; of models, what they say but for the time of day."""
    found = {}
    for file in sorted(folder.iterdir()):
        if file.name.startswith(".pamid-") or file.is_dir():
            continue
        content: object = file.read_bytes()
        if file.suffix == ".pamid":
            content = {k: v for k, v in sorted(vars(_last(load(file))).items()) if not k.startswith("_")}
        found[file.name] = hashlib.sha256(repr(content).encode()).hexdigest()
    return found


def _last(model: object) -> object:
    return model.steps[-1][1] if hasattr(model, "steps") else model


def prepared(folder: Path, source: Path, others: bool) -> None:
    """Make a folder with old results and files of the user."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    (folder / "notes.txt").write_text("mine")
    if others:
        (folder / "photos").mkdir()
        (folder / "photos" / "one.txt").write_text("mine too")


def check_whole(folder: Path, old: dict[str, str], new: dict[str, str], argv: list[str]) -> str:
    """Assert that a folder holds all of the old results or all of the new ones; say which."""
    if (folder / UNFINISHED).exists():  # it says that it is no whole set, and the next writer makes it one
        assert run(argv) == 0
        assert not list(folder.glob(".pamid-*/*"))
    found = state(folder)
    assert found.pop("notes.txt") == hashlib.sha256(repr(b"mine").encode()).hexdigest()
    assert found in (old, new), f"{sorted(found)} is neither {sorted(old)} nor {sorted(new)}"
    return "old" if found == old else "new"


@pytest.fixture(scope="module")
def results(bench, tmp_path_factory) -> Callable[[str, str], Path]:
    """Return a function that runs a command once and gives the folder of what it wrote."""
    folder = tmp_path_factory.mktemp("results")

    def of(name: str, which: str) -> Path:
        target = folder / f"{name}-{which}"
        if not target.exists():
            target.mkdir()
            assert run(command(name, which, bench, target)) == 0
        return target

    return of


def killed(name, number, bench, results, tmp_path, *, others=False, last=None, every=1) -> int:
    """Kill a command before each touch of its folder, or before the last few; return the number of kills."""
    old, new = state(results(name, "old")), state(results(name, "new"))
    assert old != new
    out, count = tmp_path / "inside" / "out", tmp_path / "count"
    argv = command(name, "new", bench, out)
    prepared(out, results(name, "old"), others)
    assert killed_at(argv, out.parent, 0, number, count) == 0
    assert check_whole(out, old, new, argv) == "new"
    steps = int(count.read_text())
    kills = range(1 if last is None else steps - last + 1, steps + 1, every)
    for step in kills:
        prepared(out, results(name, "old"), others)
        code = killed_at(argv, out.parent, step, number)
        assert code in (-number, 128 + number), f"{code} at step {step} of {steps}"
        if number != signal.SIGKILL:
            assert not list(out.parent.rglob(".pamid-*")), "a command that is asked to end leaves no draft"
        check_whole(out, old, new, argv)
        if others:
            assert (out / "photos" / "one.txt").read_text() == "mine too"
        shutil.rmtree(out.parent)
    return len(kills)


@pytest.mark.parametrize("name", SHORT)
def test_a_command_that_is_killed_leaves_the_old_files_or_the_new(name, bench, results, tmp_path):
    killed(name, signal.SIGKILL, bench, results, tmp_path, last=4)


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_a_long_command_that_is_killed_leaves_the_old_files_or_the_new(name, bench, computed, results, tmp_path):
    killed(name, signal.SIGKILL, bench, results, tmp_path, last=4)


@pytest.mark.long
def test_two_hundred_kills_at_every_step_lose_nothing(bench, computed, results, tmp_path):
    kills = 0
    for name in (*SHORT, *LONG):
        for number in SIGNALS:
            every = 1 if number == signal.SIGKILL else 3
            kills += killed(name, number, bench, results, tmp_path, every=every)
    for name in ("diagnose", "export", "init", "simulate"):
        kills += killed(name, signal.SIGKILL, bench, results, tmp_path, others=True)
    print(f"{kills} kills")
    assert kills >= 200


def test_every_command_that_writes_is_killed_here():
    parser = build_parser()
    commands = next(a for a in parser._actions if a.dest == "command").choices
    found = {
        name: {o for o in c._option_string_actions if o in ("--out", "--html", "--checkpoint")}
        for name, c in commands.items()
    }
    assert {name: options for name, options in found.items() if options} == WRITES
    assert {name.split("-")[0] for name in (*SHORT, *LONG)} == set(WRITES) - {"demo"}


def test_the_other_commands_write_nothing(bench):
    def watched() -> None:
        sys.dont_write_bytecode = True

        def hook(event: str, args: tuple) -> None:
            if event in TOUCHES[1:7] or (
                event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR)
            ):
                os._exit(99)

        sys.addaudithook(hook)

    sim = ["--sim", str(bench / "sim.toml")]
    assert (
        run(["simulate", "--trajectory", "sine:frequency=4,amplitude=9", "--out", str(bench / "x.csv")], watched) == 99
    )
    for argv in (
        ["evaluate", str(bench / "new.csv"), *sim],
        ["watch", str(bench / "new.csv"), *sim],
        ["completion", "bash"],
    ):
        assert run(argv, watched) in (0, 2), argv


def test_a_demo_that_is_killed_leaves_each_of_its_sets_whole(tmp_path, monkeypatch):
    """A demo is a row of commands: what a later one writes is new only if the earlier ones' files are."""

    def steps(folder: Path) -> list[tuple[str, list[str]]]:
        log, runs = str(folder / "log.csv"), "sine:frequency=4,amplitude=15,seconds=0.2"
        fit = ["fit", log, "--estimator", "GeometricForce", "--sim", str(folder / "log.sim.toml"), "--folds", "0"]
        return [
            ("Simulate", ["simulate", "--trajectory", runs, "--effect", "leakage", "--out", log]),
            ("Fit", [*fit, "--out", str(folder / "force.pamid")]),
        ]

    monkeypatch.setattr(demo, "PARTS", (steps,))
    out, count = tmp_path / "inside" / "out", tmp_path / "count"
    out.parent.mkdir()
    argv = ["demo", "--out", str(out), "--quiet", "--seed"]
    assert killed_at([*argv, "1"], out.parent, 0, signal.SIGKILL, count) == 0
    new = state(out)
    shutil.rmtree(out)
    assert run([*argv, "0"]) == 0
    old = state(out)
    shutil.copytree(out, tmp_path / "old")
    total = int(count.read_text())
    for step, number in zip(range(1, total + 1, max(1, total // 15)), itertools.cycle(SIGNALS), strict=False):
        prepared(out, tmp_path / "old", False)
        assert killed_at([*argv, "1"], out.parent, step, number) in (-number, 128 + number)
        found = state(out)
        found.pop("notes.txt")
        assert found.keys() == old.keys()
        simulated = {name: digest for name, digest in found.items() if name != "force.pamid"}
        assert simulated in ({k: old[k] for k in simulated}, {k: new[k] for k in simulated})
        assert found["force.pamid"] == old["force.pamid"] or found == new
    assert total > 15


# --- two writers ----------------------------------------------------------------------------------------------------
def two_at_once(name: str, bench: Path, results: Callable[[str, str], Path], out: Path) -> None:
    """Run the command that writes the old results and the one that writes the new ones side by side, some times."""
    old, new = (state(results(name, which)) for which in ("old", "new"))
    for others in (False, True):
        prepared(out, results(name, "old"), others)

        def both() -> int:
            other = os.fork()
            code = main(command(name, "old" if other == 0 else "new", bench, out))
            if other == 0:
                os._exit(code)
            return code or os.waitstatus_to_exitcode(os.waitpid(other, 0)[1])

        assert forked(both) == 0
        check_whole(out, old, new, [])
        assert not (out / UNFINISHED).exists()
        assert not list(out.parent.rglob(".pamid-*"))


@pytest.mark.parametrize("name", SHORT)
def test_two_commands_at_once_leave_the_whole_of_one(name, bench, results, tmp_path):
    two_at_once(name, bench, results, tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_two_long_commands_at_once_leave_the_whole_of_one(name, bench, computed, results, tmp_path):
    two_at_once(name, bench, results, tmp_path / "out")


# --- no room --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", SHORT)
def test_a_kill_in_mid_write_or_a_full_disk_leave_the_old_files(name, bench, results, tmp_path):
    no_room(name, bench, results, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_a_long_command_without_room_leaves_the_old_files(name, bench, computed, results, tmp_path):
    no_room(name, bench, results, tmp_path)


def no_room(name: str, bench: Path, results: Callable[[str, str], Path], tmp_path: Path) -> None:
    """Run a command into the end of a disk at several sizes of a file, and into a kill there."""
    old, new = state(results(name, "old")), state(results(name, "new"))
    out = tmp_path / "out"
    argv = command(name, "new", bench, out)
    largest = max(f.stat().st_size for f in results(name, "new").iterdir())
    for size in (0, 100, 9 * largest // 10):  # a model file has some bytes more or less each time
        prepared(out, results(name, "old"), False)
        # A compiler that the command starts may be the one that is killed; the command then says so.
        assert killed_in_write(argv, size) in ((-signal.SIGXFSZ, 2) if name == "export-fmu" else (-signal.SIGXFSZ,))
        assert check_whole(out, old, new, argv) == "old"
        for draft in tmp_path.glob(".pamid-*"):  # nobody is left to remove it
            shutil.rmtree(draft)
        prepared(out, results(name, "old"), False)
        assert without_room(argv, size) == 2
        assert check_whole(out, old, new, argv) == "old"
        assert not list(tmp_path.rglob(".pamid-*"))


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A disk of 256 KiB of its own, full but for a few bytes."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(folder)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no right to mount a disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize(
    "name", [*SHORT, "adapt", "export", "check", "check-html", "diagnose", "compare", "next", "passport", "resid"]
)
def test_a_full_disk_is_noticed_before_the_work_begins(name, bench, results, small_disk, monkeypatch, capsys):
    def reached(*_: Any, **__: Any) -> None:
        raise AssertionError("the work has begun")

    kept = {}
    if name not in SHORT:
        (small_disk / "out").mkdir()
    else:
        shutil.copytree(results(name, "old"), small_disk / "out")
        kept = state(small_disk / "out")
    with (small_disk / "filler").open("wb", buffering=0) as stream, contextlib.suppress(OSError):
        while True:
            stream.write(b"x" * 4096)
    for module, work in ((pamid.bench, "simulate"), (pamid.signals, "read_log")):
        monkeypatch.setattr(module, work, reached)
    assert main(command(name, "new", bench, small_disk / "out")) == 2
    assert "cannot be written: No space left on device" in capsys.readouterr().err
    if kept:
        assert state(small_disk / "out") == kept
    assert not list(small_disk.rglob(".pamid-*"))


def test_an_error_names_the_file_that_the_user_knows(tmp_path):
    def ends() -> int:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))
        words = f"{tmp_path / 'out' / 'a'} cannot be written"
        with pytest.raises(OutputError, match=words), replacing_together(tmp_path / "out", ["a"]) as stage:
            write_whole(stage / "a", "x" * 100)
        return 0

    assert forked(ends) == 0


def test_an_output_that_is_missing_protected_or_no_file_is_refused(bench, tmp_path, capsys):
    here = str(tmp_path)
    os.mkfifo(tmp_path / "pipe.csv")
    for out, said in {
        f"{here}/none/log.csv": "does not exist",
        f"{here}/pipe.csv": "a device or a pipe",
        "/proc/log.csv": "cannot be written",
    }.items():
        assert main(["simulate", "--trajectory", "sine:frequency=4,amplitude=9", "--out", out]) == 2
        assert said in capsys.readouterr().err
    log, sim = str(bench / "new.csv"), str(bench / "sim.toml")
    assert main(["fit", log, "--sim", sim, "--estimator", "GeometricForce", "--out", log]) == 2
    assert "is what this command reads" in capsys.readouterr().err
    assert main(["check", log, "--html", "/dev/null"]) == 2
    assert Path("/dev/null").is_char_device()
