"""A small further cause of any other simulator than the bench is named with reservations."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap.diagnosis import open_set
from pamid.gap.diagnosis.trusted import BESIDE


@pytest.mark.parametrize(("share", "exact", "sure"), [(0.03, False, False), (0.2, False, True), (0.03, True, True)])
def test_what_explains_a_few_per_cent_beside_another_cause_is_no_sure_name(monkeypatch, share, exact, sure):
    signs = {name: {**dict.fromkeys(BESIDE, 0.0), "left_where_it_acts": 0.0, "faint": -0.25 * np.log(part)}
             for name, part in (("first", 1.0 - share), ("second", share))}  # fmt: skip
    monkeypatch.setattr(open_set, "signs_of", lambda *a: signs)
    monkeypatch.setattr(open_set, "taken_back", lambda *a: {})
    outcome = SimpleNamespace(best=SimpleNamespace(fit=SimpleNamespace(spec=dict.fromkeys(signs))))
    found = open_set.trust(SimpleNamespace(evidence=SimpleNamespace(exact=exact, simulates=True)), outcome, {}, {})
    assert found["first"].grade == "sure"
    assert found["second"].grade == ("sure" if sure else "reserve")
