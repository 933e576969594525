"""Runs of a simulator that answers a whole run at once, under forces that depend on what it answers."""

from __future__ import annotations

import numpy as np

from pamid.simulators.play_runs import ROUNDS, _Balance


def test_a_strong_friction_is_balanced_though_each_round_overshoots() -> None:
    """Plain iteration diverges before it converges: over 6 s at 2 per second its error grows a thousandfold."""
    t = np.arange(0.0, 6.0, 0.02)
    drive = np.stack([[np.sin(2.0 * t)], [np.sign(np.sin(t))]])  # runs, inputs, rows

    def speeds(given: np.ndarray) -> list[dict[str, np.ndarray]]:
        held = np.cumsum(given[:, 0], axis=1) * 0.02
        return [{"v": np.concatenate([[0.0], v[:-1]])} for v in held]

    balance, found, rounds = _Balance(drive), speeds(drive), 0
    while not balance.holds(drive - 2.0 * np.array([[one["v"]] for one in found]), found):
        found, rounds = speeds(balance.step()), rounds + 1
        assert rounds < ROUNDS
    exact = np.zeros((2, len(t)))
    for k in range(len(t) - 1):
        exact[:, k + 1] = exact[:, k] + 0.02 * (drive[:, 0, k] - 2.0 * exact[:, k])
    assert np.allclose([one["v"] for one in balance.best], exact, atol=2e-3)
