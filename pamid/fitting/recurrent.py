"""A recurrent network on batches of sequences: its weights, its forward pass, and how rows become sequences."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .epochs import Weights

CELLS = ("gru", "lstm", "elman")
_GATES = {"gru": 3, "lstm": 4, "elman": 1}


def initial_weights(rng: np.random.Generator, cell: str, n_inputs: int, hidden: int, layers: int) -> Weights:
    """Draw weights uniformly within 1/√hidden, torch's own initialisation, from a local generator."""
    bound = 1.0 / np.sqrt(hidden)
    rows = _GATES[cell] * hidden
    weights: Weights = {}
    for layer in range(layers):
        width = n_inputs if layer == 0 else hidden
        for name, shape in (("weight_ih", (rows, width)), ("weight_hh", (rows, hidden))):
            weights[f"{name}_l{layer}"] = rng.uniform(-bound, bound, shape)
        for name in ("bias_ih", "bias_hh"):
            weights[f"{name}_l{layer}"] = rng.uniform(-bound, bound, rows)
    weights["out_weight"] = rng.uniform(-bound, bound, (1, hidden))
    weights["out_bias"] = np.zeros(1)
    return weights


class Network:
    """The forward pass for given weights; holds the torch module only while it is used."""

    def __init__(self, cell: str, n_inputs: int, hidden: int, layers: int, tensors: dict[str, Any]) -> None:
        import torch

        kind = {"gru": torch.nn.GRU, "lstm": torch.nn.LSTM, "elman": torch.nn.RNN}[cell]
        device = next(iter(tensors.values())).device
        # made on the meta device, the module draws no weights of its own: torch's global generator stays where it is
        module: Any = kind(n_inputs, hidden, layers, batch_first=True, device="meta", dtype=torch.float64)
        module.to_empty(device=device)
        for name, tensor in tensors.items():
            if not name.startswith("out_"):
                setattr(module, name, torch.nn.Parameter(tensor.detach()))
        self.module = module
        self._out: dict[str, Any] = {
            name: torch.nn.Parameter(tensors[name].detach()) for name in ("out_weight", "out_bias")
        }

    def parameters(self) -> dict[str, Any]:
        """Return every trained tensor by the name of its weight."""
        return {**dict(self.module.named_parameters()), **self._out}

    def run(self, inputs: Any, state: Any = None) -> tuple[Any, Any]:
        """Run over sequences (batch, time, n_inputs) from a state; return outputs (batch, time) and the last state."""
        hidden, state = self.module(inputs, state)
        return (hidden @ self._out["out_weight"].T + self._out["out_bias"])[..., 0], state


def detached(state: Any) -> Any:
    """Cut a state off from the graph that made it: where a truncated window ends."""
    return tuple(part.detach() for part in state) if isinstance(state, tuple) else state.detach()


@dataclass(frozen=True)
class Piece:
    """A run of rows of one run, and the rows that lead into it."""

    start: int
    stop: int
    first: int
    """First row of the run, before which nothing is ever read."""

    def lead(self, n: int) -> np.ndarray:
        """Rows that lead in: those before the piece, the first of the run repeated where there are none."""
        return np.maximum(np.arange(self.start - n, self.start), self.first)

    def rows(self) -> np.ndarray:
        """Rows of the piece."""
        return np.arange(self.start, self.stop)


def pieces_of(slices: list[slice], length: int | None) -> list[Piece]:
    """Cut runs into pieces of at most `length` rows, which run side by side."""
    pieces = []
    for rows in slices:
        step = rows.stop - rows.start if length is None else length
        pieces += [Piece(a, min(a + step, rows.stop), rows.start) for a in range(rows.start, rows.stop, step)]
    return pieces


def index_table(pieces: list[Piece], burn_in: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of a batch of pieces: leading rows, rows padded to one length, and which of these are real."""
    longest = max(p.stop - p.start for p in pieces)
    lead = np.stack([p.lead(burn_in) for p in pieces])
    table = np.stack([np.minimum(np.arange(p.start, p.start + longest), p.stop - 1) for p in pieces])
    real = np.stack([np.arange(longest) < p.stop - p.start for p in pieces])
    return lead, table, real
