"""Work that is killed goes on where it was, to the same result; no half-written file is read as whole."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from unittest import mock

import numpy as np
import pytest
from sklearn.base import clone

from pamid import load
from pamid.checkpoint import Checkpoint
from pamid.errors import CheckpointError, OutputError

WORK = """
import sys, time
from pathlib import Path
from pamid.checkpoint import Checkpoint

file, log = Path(sys.argv[1]), Path(sys.argv[2])
kept = Checkpoint(file, {"seed": 1})

def compute(k):
    with log.open("a") as out:
        out.write(f"{k}\\n")
    time.sleep(0.02)
    return [k, k * 0.1, "x" * 2000]

print(sum(kept.step(str(k), lambda k=k: compute(k))[1] for k in range(30)))
"""


def test_work_that_is_killed_goes_on_to_the_same_result(tmp_path):
    file, log = tmp_path / "work.json", tmp_path / "log"
    command = [sys.executable, "-c", WORK, str(file), str(log)]
    kills = 0
    for wanted in (2, 9, 17):
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            for _ in range(3000):
                if log.exists() and len(log.read_text().split()) > wanted:
                    break
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
            kills += process.wait() == -signal.SIGKILL
        assert len(json.loads(file.read_text())["results"]) > wanted - 1 - kills, (
            "what was finished is whole and on disk"
        )
    assert kills == 3
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert float(done.stdout) == sum(k * 0.1 for k in range(30))
    computed = log.read_text().split()
    assert sorted(set(map(int, computed))) == list(range(30))
    assert len(computed) <= 30 + kills, "no more than the step that was cut short is done twice"


def test_a_damaged_or_foreign_checkpoint_is_refused(tmp_path):
    file = tmp_path / "work.json"
    Checkpoint(file, {"seed": 1}).step("a", lambda: 1)
    with pytest.raises(CheckpointError, match="another run"):
        Checkpoint(file, {"seed": 2})
    file.write_text(file.read_text()[:-5])
    with pytest.raises(CheckpointError, match="not a checkpoint"):
        Checkpoint(file, {"seed": 1})


def test_a_full_disk_keeps_the_last_whole_checkpoint(tmp_path):
    file = tmp_path / "work.json"
    kept = Checkpoint(file)
    kept.step("a", lambda: 1)
    with mock.patch("os.fsync", side_effect=OSError(28, "No space left on device")), pytest.raises(OutputError):
        kept.step("b", lambda: 2)
    assert Checkpoint(file).results == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["work.json"]


# --- fits ---------------------------------------------------------------------------------------------------
FITS = """
import os, random, signal, sys, threading, time
from pathlib import Path
import numpy as np
import pamid.training.resume
from pamid.estimators import StaticPIHM
from pamid.training import Adam, LevenbergMarquardt

pamid.training.resume.EVERY = 0.0
folder = Path(sys.argv[1])
rng = np.random.default_rng(0)
X = rng.uniform([0.02, -0.5, 2e5, -1e6], [0.2, 0.5, 5e5, 1e6], (200, 4))
y = (X[:, 2] - 101_325) * 5e-4 * (1 - 3 * X[:, 0]) + rng.normal(0, 1.0, 200)
groups = np.repeat(np.arange(5), 40)


def model(kind, **settings):
    class Slow(kind):
        def steps(self, *args, **kwargs):
            for number, step in enumerate(super().steps(*args, **kwargs), start=1):
                if number == doom:
                    killer.start()
                time.sleep(0.004)
                yield step

    kept = settings.pop("checkpoint", None)
    fraction = settings.pop("validation_fraction", 0)
    trainer = (Slow if kept else kind)(**settings, checkpoint=kept)
    return StaticPIHM(
        hidden_layer_sizes=(6,), trainer=trainer, volume_model="neural", validation_fraction=fraction, random_state=3
    )


def fit(number, kind, settings):
    fitted = model(kind, **settings, checkpoint=str(folder)).fit(X, y, groups=groups)
    np.savez(folder / f"done-{number}.npy", *fitted.weights_, np.array(fitted.loss_curve_))
    (folder / f"status-{number}").write_text(f"{fitted.status_} {fitted.n_iter_}")


random.seed(4)
for number, (kind, settings) in enumerate([
    (Adam, {"max_iter": 50, "batch_size": 64, "learning_rate": 1e-2}),
    (LevenbergMarquardt, {"max_iter": 20, "batch_size": 64}),
    (LevenbergMarquardt, {"max_iter": 60, "batch_size": 256, "patience": 4, "validation_fraction": 0.3}),
]):
    kills = 0
    for attempt in range(60):
        # Counted in steps of the fit, a blow falls inside it on a fast machine as on a slow one; the delay lets it
        # fall on the step, on the writing of the checkpoint or between them.
        doom = random.randint(1, 5) if attempt < 3 else 0
        delay = random.uniform(0.0, 0.01)
        child = os.fork()
        if child == 0:
            killer = threading.Timer(delay, os.kill, (os.getpid(), signal.SIGKILL))
            fit(number, kind, settings)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status):
            break
        kills += 1
    alone = model(kind, **settings).fit(X, y, groups=groups)
    with np.load(folder / f"done-{number}.npy.npz") as found:
        kept = [found[k] for k in found.files]
    same = all(np.array_equal(a, b) for a, b in zip(kept, [*alone.weights_, np.array(alone.loss_curve_)]))
    status = (folder / f"status-{number}").read_text() == f"{alone.status_} {alone.n_iter_}"
    print(kind.__name__, kills, same, status, alone.status_)
"""


def test_fits_that_are_killed_go_on_to_the_same_weights(tmp_path):
    if not hasattr(os, "fork"):
        pytest.skip("no fork on this system")
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, "-W", "ignore", "-c", FITS, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **threads})
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert [line[0] for line in lines] == ["Adam", "LevenbergMarquardt", "LevenbergMarquardt"]
    for name, kills, same, status, _ in lines:
        assert int(kills) >= 1, f"{name} was never killed"
        assert (same, status) == ("True", "True"), f"{name} came to another result"
    assert lines[2][4] == "stopped_early"


def test_every_training_has_a_file_of_its_own_and_a_finished_one_is_not_done_again(tmp_path):
    from pamid.estimators import StaticPIHM

    from pamid.training import LevenbergMarquardt

    rng = np.random.default_rng(0)
    X = rng.uniform([0.02, -0.5, 2e5, -1e6], [0.2, 0.5, 5e5, 1e6], (80, 4))
    y = (X[:, 2] - 101_325) * 5e-4 * (1 - 3 * X[:, 0])
    trainer = LevenbergMarquardt(max_iter=4, checkpoint=str(tmp_path / "kept"))
    model = StaticPIHM(hidden_layer_sizes=(4,), trainer=trainer, random_state=0)
    first = model.fit(X, y).weights_
    (file,) = (tmp_path / "kept").iterdir()
    with mock.patch.object(LevenbergMarquardt, "steps", side_effect=AssertionError("fitted again")):
        again = clone(model).fit(X, y).weights_
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    clone(model).set_params(random_state=1).fit(X, y)
    y[3] += 1e-9
    clone(model).fit(X, y)
    assert len(list((tmp_path / "kept").iterdir())) == 3
    y[3] -= 1e-9
    file.write_bytes(file.read_bytes()[:-40])
    y[3] = (X[3, 2] - 101_325) * 5e-4 * (1 - 3 * X[3, 0])
    with pytest.raises(CheckpointError, match="not a checkpoint"):
        clone(model).fit(X, y)
    with pytest.raises(OutputError, match="cannot be made"):
        clone(model).set_params(trainer__checkpoint=str(file / "in")).fit(X, y)
    full = mock.patch("os.fsync", side_effect=OSError(28, "No space left on device"))
    with full, pytest.raises(OutputError, match="No space left"):
        clone(model).set_params(random_state=5).fit(X, y)
    assert [p.name for p in (tmp_path / "kept").iterdir() if p.suffix != ".npz"] == []


def test_the_command_goes_on_and_leaves_no_path_in_the_model(tmp_path, capsys):
    from pamid.cli import main
    from pamid.training import LevenbergMarquardt

    log, kept = tmp_path / "log.parquet", tmp_path / "kept"
    run = "sine:frequency=4,amplitude=15,seconds=1"
    assert main(["simulate", "--trajectory", run, "--out", str(log), "--quiet"]) == 0
    fit = ["fit", str(log), "--sim", str(log.with_suffix(".sim.toml")), "--folds", "0", "--thin", "20", "--quiet"]
    hybrid = [*fit, "--estimator", "StaticPIHM", "--set", "hidden_layer_sizes=(4,)", "--set", "max_iter=3"]
    hybrid += ["--checkpoint", str(kept), "--out"]
    assert main([*hybrid, str(tmp_path / "first.pamid")]) == 0
    with mock.patch.object(LevenbergMarquardt, "steps", side_effect=AssertionError("fitted again")):
        assert main([*hybrid, str(tmp_path / "again.pamid")]) == 0
    first, again = (load(tmp_path / f"{name}.pamid")[-1] for name in ("first", "again"))
    assert all(np.array_equal(a, b) for a, b in zip(first.weights_, again.weights_, strict=True))
    assert first.trainer == "levenberg_marquardt"
    capsys.readouterr()
    plain = [*fit, "--estimator", "PolynomialForce", "--checkpoint", str(kept), "--out", str(tmp_path / "p.pamid")]
    assert main(plain) == 2
    assert "PolynomialForce has no trainer" in capsys.readouterr().err


def test_two_processes_that_write_one_file_leave_one_of_theirs_whole(tmp_path):
    file = tmp_path / "shared.bin"
    code = """
import sys
from pamid.files import write_whole
for _ in range(60):
    write_whole(sys.argv[1], sys.argv[2].encode() * 100_000)
"""
    writers = [subprocess.Popen([sys.executable, "-c", code, str(file), letter]) for letter in "ab"]
    seen = set()
    while any(w.poll() is None for w in writers):
        if file.exists():
            content = file.read_bytes()
            assert len(content) == 100_000
            assert len(set(content)) == 1
            seen.add(content[:1])
    assert [w.returncode for w in writers] == [0, 0]
    assert seen == {b"a", b"b"}
    assert [p.name for p in tmp_path.iterdir()] == ["shared.bin"]
