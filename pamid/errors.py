"""Every error and warning pamid raises, worded in one way: what was found, what was expected, what to do.

Each class also derives from the builtin that a scikit-learn user expects (``ValueError``, ``TypeError``, ...),
so ``except ValueError`` keeps working and the command line can turn any `PamidError` into one clear line.
"""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

_MOST = 2_000
"""Characters shown of each part of a message, so that the contents of a file cannot fill the screen."""


_LONG = 25
"""Number of names beyond which a list is not shown in full: it would fill more than two lines."""


def _readable(text: str) -> str:
    if len(text) <= _MOST:
        return text
    return f"{text[: _MOST // 2]} [... {len(text) - _MOST:,} characters ...] {text[-_MOST // 2 :]}"


class PamidError(Exception):
    """Base of all errors of the package.

    Parameters
    ----------
    found : str
        What was found, as a full sentence, with numbers and units.
    expected : str
        What was expected instead; completes a sentence that begins with "Expected".
    remedy : str
        What the user can do about it, as a full sentence.

    Attributes
    ----------
    page : str
        Page of the docs, with its section, that helps.
    """

    page: str = "docs/command-line.md"

    def __init__(self, found: str, expected: str = "", remedy: str = "") -> None:
        found, expected, remedy = (_readable(part) for part in (found, expected, remedy))
        self.found = found
        self.expected = expected
        self.remedy = remedy
        parts = [found.rstrip()]
        if expected:
            parts.append(f"Expected {expected.rstrip().rstrip('.')}.")
        if remedy:
            parts.append(remedy.rstrip())
        super().__init__(" ".join(parts))

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        """Rebuild from the three parts, so that errors cross process borders whole."""
        return type(self), (self.found, self.expected, self.remedy)


def among(name: object, known: Iterable[str], otherwise: str = "Correct the name.") -> tuple[str, str]:
    """Return expectation and remedy for an unknown name; a long list is cut to similar names."""
    names = list(known)
    close = difflib.get_close_matches(str(name), names, n=3)
    expected = "a known name" if close and len(names) > _LONG else f"one of {', '.join(names)}"
    return expected, f"Did you mean {' or '.join(close)}?" if close else otherwise


# --- logs: the file -----------------------------------------------------------------------------------------
class LogError(PamidError, ValueError):
    """A log cannot be used as it is."""

    page = "docs/logs.md"


class LogNotFoundError(LogError, FileNotFoundError):
    """No file where the log should be."""


class LogFormatError(LogError):
    """A file of a kind that is not read, or whose content does not match its name."""


class TruncatedLogError(LogError):
    """The file ends before it should, or is damaged."""


class HostileLogError(LogFormatError):
    """A log contains objects, or is or claims to be too large to be read safely."""


class StreamError(LogError):
    """A stream does not contain samples."""

    page = "docs/streaming.md"


class EmptyLogError(LogError):
    """The log has no rows."""


# --- logs: the columns --------------------------------------------------------------------------------------
class ColumnError(LogError):
    """Something is wrong with the columns of a log or a table."""

    page = "docs/logs.md#the-tidy-table"


class MissingColumnError(ColumnError):
    """A required column is missing."""


class DuplicateColumnError(ColumnError):
    """Two columns carry the same name, or two sources map to one signal."""


class ColumnTypeError(ColumnError, TypeError):
    """A column holds text or objects where numbers are needed."""


class MappingError(ColumnError):
    """A mapping of names and units is malformed or refers to something missing."""

    page = "docs/logs.md#mappings"


# --- logs: the values ---------------------------------------------------------------------------------------
class SignalError(LogError):
    """The values of a signal are not usable."""


class NonFiniteError(SignalError):
    """NaN or infinite values in a signal."""

    page = "docs/logs.md#missing-values-gaps-order"


class ReadingError(SignalError):
    """A reading that its quantity cannot take, such as an absolute pressure of 0."""

    page = "docs/logs.md#impossible-readings"


class ExcitationError(SignalError):
    """A log excites the system too little for the task."""

    page = "docs/first_hour.md#look-at-it"


class UnitError(SignalError):
    """Values are clearly in the wrong unit, or their unit is unknown."""

    page = "docs/logs.md#units"


class PressureReferenceError(UnitError):
    """Gauge pressure where absolute pressure is needed, or the reverse."""


# --- time and runs ----------------------------------------------------------------------------------
class TimeError(SignalError):
    """Time is not usable."""

    page = "docs/logs.md#missing-values-gaps-order"


class TimeOrderError(TimeError):
    """Time does not increase within a run."""


class SamplingError(TimeError):
    """The sampling is too irregular, too slow or too mixed for the task."""


class TrajectoryError(LogError):
    """Something is wrong with the runs of a log."""

    page = "docs/logs.md#the-tidy-table"


class MissingTrajectoryError(TrajectoryError):
    """A method that needs time order got neither ``groups`` nor a ``trajectory`` column."""

    page = "docs/pipelines.md"


class InterleavedTrajectoryError(TrajectoryError):
    """The rows of a run are not contiguous."""


class TooFewTrajectoriesError(TrajectoryError):
    """Fewer runs than a grouped split needs."""

    page = "docs/pipelines.md"


class ShortTrajectoryError(TrajectoryError):
    """A run has fewer samples than an operation needs."""


# --- parameters and fits ------------------------------------------------------------------------------------
class ParameterError(PamidError, ValueError):
    """A parameter of an estimator, a law or a command is out of its domain."""


class UnknownOptionError(ParameterError):
    """A name that is not one of the choices."""


class ShapeError(PamidError, ValueError):
    """Arrays whose shapes do not belong together."""

    page = "docs/models.md"


class IncompatibleError(PamidError, ValueError):
    """A volume model, a law and a trainer or adapter that do not work together."""

    page = "docs/models.md"


class FitError(PamidError, RuntimeError):
    """A fit could not be carried out or gave nothing usable."""

    page = "docs/models.md"


class DivergedError(FitError):
    """A fit or a simulation has diverged."""


class UnreachableError(PamidError, ValueError):
    """A desired pair of force and contraction that no pressure within the limits produces."""

    page = "docs/inverse.md"


# --- simulator files ----------------------------------------------------------------------------------------
class SimulatorFileError(PamidError, ValueError):
    """A simulator file (``sim.toml``) is not usable."""

    page = "docs/simulator.md#the-simulator-file"


class UntrustedCodeError(SimulatorFileError):
    """A simulator file names code (a Python function, an FMU) that is not trusted yet, so it is not run."""

    page = "docs/simulators.md#trust"


class ForeignSimulatorError(PamidError, RuntimeError):
    """A third-party simulator has crashed, hung or failed."""

    page = "docs/simulator-fmu.md"


class EffectError(PamidError, RuntimeError):
    """The code of an effect has failed."""

    page = "docs/own_effect.md"


class LackingNumberError(PamidError, AttributeError):
    """An effect reads a number that the system does not have."""

    page = "docs/own_effect.md"


class SimulatorNotFoundError(SimulatorFileError, FileNotFoundError):
    """No file where the simulator should be."""


class OversizedSimulatorError(SimulatorFileError):
    """A file far too large to be a simulator file."""


class SimulatorRunError(SimulatorFileError):
    """A user's simulator raises an error, or returns values that are not finite."""

    page = "docs/simulators.md"


class SimulatorTypeError(SimulatorFileError, TypeError):
    """A simulator parameter is of the wrong type, such as text where a number belongs."""


class SimulatorSyntaxError(SimulatorFileError):
    """A simulator file or a model is malformed, or of a form that is not supported."""


class MissingParameterError(SimulatorFileError):
    """A simulator file lacks a table or parameter."""


class UnknownParameterError(SimulatorFileError):
    """A table, parameter or option is given that the simulator or the effect does not have."""


class ImplausibleParameterError(SimulatorFileError):
    """A simulator parameter is outside its physical range."""


# --- model files --------------------------------------------------------------------------------------------
class ModelFileError(PamidError, ValueError):
    """A model file cannot be read."""

    page = "docs/models.md"


class ModelNotFoundError(ModelFileError, FileNotFoundError):
    """No file where the model should be."""


class TruncatedModelError(ModelFileError):
    """A model file is truncated or damaged."""


class HostileModelError(ModelFileError):
    """A model file asks for code or types that loading must never run."""


class ModelVersionError(ModelFileError):
    """A model file has a format that this version of pamid cannot read."""


class OutputError(PamidError, OSError):
    """An output cannot be written."""


class CheckpointError(PamidError, ValueError):
    """A checkpoint is damaged, or belongs to a run with other settings."""


class ExportError(PamidError, ValueError):
    """A model, or a part of it, cannot be exported."""

    page = "docs/export.md"


class MissingDependencyError(PamidError, ImportError):
    """An optional dependency is not installed."""


@contextmanager
def needs(package: str, extra: str, module: str = "") -> Iterator[None]:
    """Name the optional dependency to install if an import fails within the block."""
    try:
        yield
    except ImportError:
        found, expected = f"{package} is not installed.", f"the package {module or package}"
        raise MissingDependencyError(found, expected, f"Install it: pip install 'pamid[{extra}]'.") from None


# --- warnings -----------------------------------------------------------------------------------------------
class PamidWarning(UserWarning):
    """Base class. Issued directly if a regression keeps no term for an output, or an extension fails to load."""


class UnitWarning(PamidWarning):
    """Values seem to be in the wrong unit."""


class ReadingWarning(PamidWarning):
    """Impossible readings, glitches and stuck sensors, and how they are treated."""


class ExcitationWarning(PamidWarning):
    """The data vary too little, or are too few, to identify a quantity or test an effect of the simulator."""


class ExtrapolationWarning(PamidWarning):
    """A prediction is requested outside the range of the training data."""


class UnstableRunWarning(PamidWarning):
    """A free run left the range of the training data and was held at its edge."""


class AdaptationWarning(PamidWarning):
    """The source model does not suit the target muscle, or the geometry contradicts the data."""


class EffectsWarning(PamidWarning):
    """A model cannot represent a cause that a diagnosis named."""


class SimulatorWarning(PamidWarning):
    """A user's simulator is random, keeps state between calls, or names a column that the log lacks."""


class StreamChangeWarning(PamidWarning):
    """The same inputs now give a different target than earlier in the stream."""


class VolumeWarning(PamidWarning):
    """The identified volume does not make physical sense."""


class InterruptedFitWarning(PamidWarning):
    """A fit was interrupted; the best model found until then is kept."""


class SamplingWarning(PamidWarning):
    """Samples are unevenly spaced, missing or doubled."""
