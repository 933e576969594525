"""When a logged flow flows: held from sample to sample, or passing through the samples; and the anchor of a flow."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.compare.protocol import prepare
from pamid.compare.timing import flow_steps, held_share
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import State
from pamid.training.anchor import fit_anchor
from pamid.volume.contact import ContactVolume

PERIOD = 1e-3
LAW = ThermodynamicFlow()
VOLUME = ContactVolume(0.2, 2.5e-3, 0.35, -0.18, 0.0, 0.05, 10.0, 7e-5, thread_compliance=4e-8)


def flow_at(t):
    """The state of a muscle that moves in two tones, and the flow that fills it."""
    a, b, c, d = 2 * np.pi * np.array([4.0, 7.0, 5.0, 9.0])
    state = State(
        0.12 + 0.05 * np.sin(a * t) + 0.03 * np.sin(b * t),
        0.05 * a * np.cos(a * t) + 0.03 * b * np.cos(b * t),
        3.5e5 + 1e5 * np.cos(c * t) + 5e4 * np.sin(d * t),
        -1e5 * c * np.sin(c * t) + 5e4 * d * np.cos(d * t),
    )
    return state, LAW.predict(*VOLUME.jet(state), state)


def table_of(lead):
    t = np.arange(2000) * PERIOD
    state, _ = flow_at(t)
    return pd.DataFrame({"trajectory": "a", "time": t, **state._asdict(), "mdot": flow_at(t + lead)[1]})


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_share_of_a_sample_that_a_flow_is_held_is_found(share):
    """A flow that is held for the share s stands in the log s/2 samples before its mean."""
    table = table_of(share * PERIOD / 2)
    step = flow_steps(table)
    assert held_share(table, table["mdot"].to_numpy(), step) == pytest.approx(share, abs=0.02)


def test_a_flow_of_few_rows_or_without_change_is_left_as_it_is():
    table = table_of(PERIOD / 2)
    flow, step = table["mdot"].to_numpy(), flow_steps(table)
    assert held_share(table[:50], flow[:50], step[:50]) == 0.0
    assert held_share(table, np.ones(len(table)), np.zeros(len(table))) == 0.0


def test_steps_do_not_look_across_the_border_of_a_run():
    table = pd.DataFrame({"trajectory": list("aabb"), "mdot": [1.0, 2.0, 5.0, 9.0]})
    assert flow_steps(table).tolist() == [0.0, 1.0, 0.0, 4.0]


def test_a_comparison_sets_a_held_flow_back_and_says_so():
    """What is scored is then the flow at the time of the state."""
    ready = prepare(table_of(PERIOD / 2), "flow", window=0)
    state = State(*(ready.table[name].to_numpy() for name in State._fields))
    wrong = np.abs(ready.table["mdot"] - LAW.predict(*VOLUME.jet(state), state))[5:]
    raw = np.abs(ready.source["mdot"] - LAW.predict(*VOLUME.jet(state), state))[5:]
    assert np.sqrt(np.mean(wrong**2)) < 0.1 * np.sqrt(np.mean(raw**2))
    assert any("hold" in note for note in ready.notes)


def test_the_anchor_of_a_flow_finds_geometry_and_stretching_threads():
    """Without force nothing tells of a contact, so the geometry and the threads alone must carry the flow."""
    state, flow = flow_at(np.arange(1500) * 1.3e-3)
    noisy = flow + 1e-6 * np.random.default_rng(0).normal(size=len(flow))
    anchor = fit_anchor(
        [(LAW, state, noisy, np.ones(len(flow)))],
        rest_length=0.2,
        rest_diameter=0.02,
        random_state=np.random.RandomState(0),
    )
    assert anchor.thread_compliance == pytest.approx(4e-8, rel=0.1)
    left = LAW.predict(*anchor.jet(state), state) - flow
    assert np.sqrt(np.mean(left**2)) < 3e-7
