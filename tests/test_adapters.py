"""Adapters: their counts, that they start at the source, and their gradients."""

from itertools import pairwise

import numpy as np
import pytest

from pamid.adapters.base import n_parameters
from pamid.adapters.fine_tuning import FineTuning
from pamid.adapters.geometry import volume_ratio
from pamid.adapters.low_rank import LowRank
from pamid.adapters.scalar import Scalar
from pamid.errors import ParameterError


def network(sizes):
    rng = np.random.default_rng(0)
    pairs = pairwise(sizes)
    return [a for m, n in pairs for a in (rng.normal(size=(n, m)), rng.normal(size=n))]


@pytest.mark.parametrize(
    ("adapter", "count"), [(FineTuning(), 17_281), (FineTuning((0,)), 640), (Scalar(4.0), 17_282), (LowRank(), 1_288)]
)
def test_counts_are_the_published_ones(adapter, count):
    assert n_parameters(adapter.initial(network((4, 128, 128, 1)), np.random.default_rng(0))) == count


@pytest.mark.parametrize(
    "adapter",
    [
        FineTuning(),
        FineTuning((1,)),
        Scalar(4.0),
        Scalar(2.0, FineTuning((0, 2))),
        LowRank(),
        Scalar(9.0, LowRank((1, 0, 1))),
    ],
)
def test_pullback_is_the_gradient_of_expand(adapter):
    source, rng = network((4, 5, 4, 1)), np.random.default_rng(1)
    psi = [p + 0.1 * rng.normal(size=p.shape) for p in adapter.initial(source, rng)]
    step = [rng.normal(size=p.shape) for p in psi]
    w = [rng.normal(size=a.shape) for a in source]

    def at(h):
        moved = adapter.expand(source, [p + h * s for p, s in zip(psi, step, strict=True)])
        return sum(float((a * b).sum()) for a, b in zip(w, moved, strict=True))

    exact = sum(float((g * s).sum()) for g, s in zip(adapter.pullback(source, psi, w), step, strict=True))
    assert exact == pytest.approx((at(1e-5) - at(-1e-5)) / 2e-5, rel=1e-6)


def test_start_multiplies_the_source_by_q0_and_leaves_it_untouched():
    source = network((4, 5, 1))
    before = [a.copy() for a in source]
    adapter = Scalar(4.0)
    psi = adapter.initial(source, np.random.default_rng(0))
    theta = adapter.expand(source, psi)
    np.testing.assert_allclose(theta[-2], 4 * source[-2])
    psi[1] += 1.0
    for a, b in zip(source, before, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("q0", [0.0, -1.0, np.nan])
def test_impossible_q0_is_refused(q0):
    with pytest.raises(ParameterError, match="factor on the volume"):
        Scalar(q0)


@pytest.mark.parametrize("layers", [(), (3,), (-1,)])
def test_layers_the_network_lacks_are_refused(layers):
    with pytest.raises(ParameterError, match="layers to train"):
        FineTuning(layers).initial(network((4, 5, 3, 1)), np.random.default_rng(0))


def test_low_rank_starts_at_the_source():
    source = network((4, 5, 4, 1))
    adapter = LowRank()
    theta = adapter.expand(source, adapter.initial(source, np.random.default_rng(0)))
    for a, b in zip(theta, source, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("ranks", [(), (0, 0), (-1, 2), (5,), (1, 1, 1, 1)])
def test_impossible_ranks_are_refused(ranks):
    with pytest.raises(ParameterError, match="rank"):
        LowRank(ranks).initial(network((4, 5, 4, 1)), np.random.default_rng(0))


def test_geometry_gives_q0_and_its_uncertainty():
    assert volume_ratio((0.1, 0.01), (0.1, 0.02)).value == pytest.approx(4)
    rng, n = np.random.default_rng(0), 200_000
    L = 1 + 0.01 * rng.normal(size=(2, n))
    D = 1 + 0.02 * rng.normal(size=(2, n))
    drawn = 4 * (D[1] / D[0]) ** 2 * L[1] / L[0]
    assert volume_ratio((0.1, 0.01), (0.1, 0.02), (0.01, 0.02)).uncertainty == pytest.approx(drawn.std(), rel=0.02)


@pytest.mark.parametrize(
    ("target", "relative"), [((0.0, 0.01), (0, 0)), ((0.1, np.nan), (0, 0)), ((0.1, 0.01), (-0.1, 0))]
)
def test_impossible_geometry_is_refused(target, relative):
    with pytest.raises(ParameterError):
        volume_ratio((0.1, 0.01), target, relative)
