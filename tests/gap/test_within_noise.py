"""What leaves less than its noise has nothing to explain: gains there are no evidence for a cause."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from pamid.gap.diagnosis.decide import within_noise
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.hypotheses import Hypothesis


@pytest.mark.parametrize(("quiet", "counts"), [(0.8, True), (1.0, False), (1.3, False)])
def test_only_gains_in_equations_below_their_noise_are_within_it(quiet: float, counts: bool) -> None:
    z = np.random.default_rng(0).standard_normal(400)
    parts, weights = [slice(0, 200), slice(200, 400)], np.array([0.5, 1.0])
    before, after = z * np.repeat([quiet, 1.5], 200), z * np.repeat([0.7, 1.0], 200)
    found = SimpleNamespace(evidence=SimpleNamespace(parts=parts), fitter=SimpleNamespace(weights=weights))
    base, best = (SimpleNamespace(fit=SimpleNamespace(z=one), left=np.array([quiet, 1.5])) for one in (before, after))
    gain = within_noise(cast(Competition, found), cast(Hypothesis, base), cast(Hypothesis, best))
    assert (gain > 5.0) == counts
