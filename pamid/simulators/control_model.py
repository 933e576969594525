"""A python-control system as a simulator: state spaces and transfer functions, in continuous or discrete time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ParameterError, needs
from .base import Simulator
from .function import ask_function, load_function, written_source
from .ports import ModelParameter, Port, merged


class ControlSimulator(Simulator):
    r"""A linear system, :math:`\dot x = A x + B u`, :math:`y = C x + D u`, or its discrete-time form.

    Its ports are named as the system's signals are: ``u[0]`` becomes ``u0``.

    Parameters
    ----------
    system : control.StateSpace or control.TransferFunction
        The system.
    ports : sequence of Port, optional
        Ports whose columns, units or starts differ from the system's own.
    parameters : mapping, optional
        None: a control system has no parameters by name.
    source : str, default=""
        Where it was imported from, for its simulator file.

    Raises
    ------
    MissingDependencyError
        python-control is not installed.
    ParameterError
        The system is neither of them.

    Examples
    --------
    >>> import control
    >>> from pamid.simulators.control_model import ControlSimulator
    >>> motor = ControlSimulator(control.tf([2.0], [0.1, 1.0], inputs="voltage", outputs="speed"))
    >>> motor.inputs, motor.outputs, motor.form
    (('voltage',), ('speed',), 'ode')
    """

    kind: ClassVar[str] = "control"
    kinds: ClassVar[tuple[str, ...]] = ("control",)

    def __init__(
        self,
        system: Any,
        ports: Sequence[Port] = (),
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
        source: str = "",
    ) -> None:
        if parameters:
            raise ParameterError(
                f"A python-control system has no named parameters, but {', '.join(parameters)} is given.",
                "none; [[effects]] can correct gains and lags",
                "For parameters with tolerances, write a function that returns the rates of the states.",
            )
        found = _state_space(system)
        self.A, self.B, self.C, self.D = (np.asarray(m, dtype=float) for m in (found.A, found.B, found.C, found.D))
        self.step = float(found.dt) if found.dt else 0.0
        self.form = "run" if self.step else "ode"
        self.source, self.folder = source, Path()
        labels = {"input": found.input_labels, "state": found.state_labels, "output": found.output_labels}
        _refuse_alike([label for some in labels.values() for label in some])
        named = [Port(_plain(label), kind) for kind, some in labels.items() for label in some]
        super().__init__(merged(named, ports), {}, effects)
        said = {p.name for p in ports if p != Port(p.name, "state")}
        unnamed = {_plain(label) for k, label in enumerate(found.state_labels) if label == f"x[{k}]"}
        self._hidden = tuple(name for name in self.states if name in unnamed - said)

    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a file; its table has ``system``, as ``module:object``."""
        source = cls.text_of(table, "system")
        system = load_function(source, folder)
        if callable(system) and not hasattr(system, "input_labels"):
            system = ask_function(system, returns="a StateSpace or TransferFunction")
        out = cls(system, ports, parameters, effects, source)
        out.folder = folder
        return out

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the simulator file's table."""
        return {"system": written_source(self.source, self.folder, folder)}

    @property
    def hidden_states(self) -> tuple[str, ...]:
        """States of a realisation that python-control numbers and no simulator file names."""
        return self._hidden

    def rate(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return A x + B u."""
        return self.A @ x + self.B @ u

    def output(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return C x + D u."""
        return self.C @ x + self.D @ u

    def run(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return the outputs of a system in steps, held between them."""
        from scipy.signal import dlsim

        given = self.step if self.step != 1.0 or len(t) < 2 else float(t[1] - t[0])
        grid = np.arange(0.0, t[-1] - t[0] + 0.5 * given, given)
        drive = np.stack([np.interp(grid, t - t[0], row) for row in u], axis=1)
        _, y, _ = dlsim((self.A, self.B, self.C, self.D, given), drive, x0=x0)
        at = np.minimum(((t - t[0]) / given + 1e-9).astype(int), len(y) - 1)
        return y[at].T


def _state_space(system: Any) -> Any:
    with needs("python-control", "control", "control"):
        import control
    if not isinstance(system, (control.StateSpace, control.TransferFunction)):
        raise ParameterError(
            f"The system is a {type(system).__name__}.", "a StateSpace or TransferFunction", "Convert it first."
        )
    try:
        found = control.ss(system)
    except Exception as error:  # python-control's own kinds, for improper and for some systems of several outputs
        raise ParameterError(
            f"python-control cannot convert the system to a state space: {error}.",
            "a proper system",
            "Write it as a StateSpace.",
        ) from error
    if not all(np.isfinite(np.asarray(m, dtype=float)).all() for m in (found.A, found.B, found.C, found.D)):
        raise ParameterError("The system's matrices are not finite.", "finite numbers", "Correct the system.")
    return found


def _refuse_alike(labels: Sequence[str]) -> None:
    """Raise where two labels give one name of a port."""
    first: dict[str, str] = {}
    for label in labels:
        if (name := _plain(label)) in first:
            raise ParameterError(
                f"The labels {first[name]!r} and {label!r} of the system both give the port {name}.",
                "labels of inputs, states and outputs that differ in letters and digits",
                "Rename one: system.update_names(inputs=..., states=..., outputs=...).",
            )
        first[name] = label


def _plain(label: str) -> str:
    return re.sub(r"\W+", "", label)
