"""The data sets of the study from a seed; the row counts of B and C are the published ones.

``paper_like`` is the bench as the authors' data are, see `pamid.bench.paper_like`.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from ..effects.spec import EffectLike
from ..names import require_one_of
from . import paper_like
from .parameters import BenchParameters
from .references import Trajectory, sine, step, triangle
from .simulation import simulate

AMPLITUDES = (5.0, 10.0, 15.0, 20.0, 25.0)
"""Amplitudes of the study, degrees."""
TRAINING_FREQUENCIES = (1.0, 2.0, 4.0, 10.0)
"""Frequencies of the training sines, rad/s."""
TRIANGLE_FREQUENCIES = (0.5, 1.0, 2.0, 4.0, 10.0)
"""Frequencies of the validation triangles, rad/s."""
ROWS = {"D_A": 31_464, "D_B": 31_464, "D_C": 30_952}
"""Number of training samples of each muscle: published for B and C, for A the same as for B."""
TRIANGLE_SAMPLES = 1_573
"""Samples of one triangle run: as many as of a training run."""
STEP_SAMPLES = 2_000
"""Samples of one step run; the step comes after 0.5 s."""


def training_trajectories(rows: int = ROWS["D_B"]) -> list[Trajectory]:
    """Return the 20 training sines.

    The recorded window of amplitude number k starts at the phase 2πk/5, so that the runs of a slow sine, shorter than
    its period, cover the cycle together.

    Parameters
    ----------
    rows : int, default=31464
        Recorded samples of all runs together.

    Returns
    -------
    list of Trajectory
        Frequency by frequency, amplitudes rising.

    Examples
    --------
    >>> from pamid.bench import training_trajectories
    >>> runs = training_trajectories(2000)
    >>> len(runs), runs[0].name
    (20, 'sine-1-5')
    """
    runs = []
    n = len(TRAINING_FREQUENCIES) * len(AMPLITUDES)
    for i, frequency in enumerate(TRAINING_FREQUENCIES):
        for k, amplitude in enumerate(AMPLITUDES):
            place = i * len(AMPLITUDES) + k
            samples = rows // n + (place < rows % n)
            runs.append(sine(frequency, amplitude, samples, phase=2.0 * math.pi * k / len(AMPLITUDES)))
    return runs


def triangle_trajectories(samples: int = TRIANGLE_SAMPLES) -> list[Trajectory]:
    """Return the 25 validation triangles, their windows spread over the cycle like those of the training.

    Parameters
    ----------
    samples : int, default=1573
        Recorded samples of each run.

    Returns
    -------
    list of Trajectory
        Frequency by frequency, amplitudes rising.

    Examples
    --------
    >>> from pamid.bench import triangle_trajectories
    >>> runs = triangle_trajectories(100)
    >>> len(runs), runs[0].name
    (25, 'triangle-0.5-5')
    """
    return [
        triangle(frequency, amplitude, samples, phase=2.0 * math.pi * k / len(AMPLITUDES))
        for frequency in TRIANGLE_FREQUENCIES
        for k, amplitude in enumerate(AMPLITUDES)
    ]


def step_trajectories(samples: int = STEP_SAMPLES) -> list[Trajectory]:
    """Return the 10 validation steps, from 0 to each amplitude in both directions.

    Parameters
    ----------
    samples : int, default=2000
        Recorded samples of each run.

    Returns
    -------
    list of Trajectory
        Amplitudes rising, the positive step first.

    Examples
    --------
    >>> from pamid.bench import step_trajectories
    >>> runs = step_trajectories(100)
    >>> len(runs), runs[0].name
    (10, 'step-0-5')
    """
    return [step(0.0, sign * amplitude, samples, lead=0.2) for amplitude in AMPLITUDES for sign in (1.0, -1.0)]


_SETS: dict[str, tuple[str, Callable[[], list[Trajectory]]]] = {
    "D_A": ("A", lambda: training_trajectories(ROWS["D_A"])),
    "D_B": ("B", lambda: training_trajectories(ROWS["D_B"])),
    "D_C": ("C", lambda: training_trajectories(ROWS["D_C"])),
    "D_tri": ("B", triangle_trajectories),
    "D_step": ("B", step_trajectories),
}
_PAPER_LIKE: dict[str, Callable[[str], list[Trajectory]]] = {
    "paper_like": paper_like.sines,
    "paper_like_tri": paper_like.triangles,
    "paper_like_step": paper_like.steps,
}
DATASETS = (*_SETS, *_PAPER_LIKE)
"""Names of the data sets."""


def dataset(
    name: str,
    seed: int = 0,
    effects: Sequence[EffectLike] = (),
    muscle: str | None = None,
    params: BenchParameters | None = None,
    **options: Any,
) -> Any:
    """Return a data set of the study, simulated.

    Parameters
    ----------
    name : str
        ``"D_A"``, ``"D_B"``, ``"D_C"`` (training sines of each muscle), ``"D_tri"`` (triangles), ``"D_step"`` (steps);
        ``"paper_like"``, ``"paper_like_tri"``, ``"paper_like_step"``: the bench as the authors' data are, its flow by
        the valve's map as theirs is; what is stated, inferred and chosen stands in `pamid.bench.paper_like`.
    seed : int, default=0
        Seed of the sensors' noise.
    effects : sequence, default=()
        Effects of the bench: objects, names, or pairs (name, parameters).
    muscle : str, optional
        ``"A"``, ``"B"`` or ``"C"``, to replace that of the data set (B if its name says none).
    params : BenchParameters, optional
        Another bench altogether; then ``muscle`` is ignored.
    **options
        Passed on to `simulate`, such as ``truth=True``.

    Returns
    -------
    DataFrame, or a pair of them with ``truth=True``
        The log, see `simulate`.

    Examples
    --------
    >>> from pamid.bench import dataset
    >>> len(dataset("D_step"))
    20000
    """
    require_one_of(name, DATASETS, f"There is no data set {name!r}.")
    if name in _PAPER_LIKE:
        return _paper_like(name, seed, effects, muscle, params, options)
    default, trajectories = _SETS[name]
    bench = params if params is not None else BenchParameters.for_muscle(muscle or default)
    return simulate(bench, trajectories(), seed=seed, effects=effects, **options)


def _paper_like(
    name: str,
    seed: int,
    effects: Sequence[EffectLike],
    muscle: str | None,
    params: BenchParameters | None,
    options: dict[str, Any],
) -> Any:
    bench = params if params is not None else paper_like.paper_like_bench(muscle or "B")
    own = bench.muscle.name if bench.muscle.name in paper_like.SETTINGS else "B"
    options = {"controller": paper_like.SETTINGS[own].controller} | options
    found = simulate(bench, _PAPER_LIKE[name](own), seed=seed, effects=effects, **options)
    paper_like.flow_by_map(found[0] if options.get("truth") else found, bench, seed)
    return found
