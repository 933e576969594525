# Written by python docs/tables.py.

from . import bench as bench
from . import compare as compare
from . import effects as effects
from . import equations as equations
from . import errors as errors
from . import estimators as estimators
from . import gap as gap
from . import laws as laws
from . import opinion as opinion
from . import persistence as persistence
from . import plots as plots
from . import report as report
from . import signals as signals
from . import training as training
from . import volume as volume
from .any_simulator import diagnose as diagnose
from .any_simulator import read_simulator as read_simulator
from .bench import BenchParameters as BenchParameters
from .bench import dataset as dataset
from .bench import simulate as simulate
from .equations import evaluate_log as evaluate_log
from .gap import evaluate as evaluate
from .gap import next_run as next_run
from .opinion import second_opinion as second_opinion
from .persistence import inspect as inspect
from .persistence import load as load
from .persistence import save as save
from .signals import read_log as read_log
from .signals import write_log as write_log

__version__: str

__all__ = [
    "BenchParameters",
    "__version__",
    "dataset",
    "diagnose",
    "evaluate",
    "evaluate_log",
    "inspect",
    "load",
    "next_run",
    "read_log",
    "read_simulator",
    "save",
    "second_opinion",
    "simulate",
    "write_log",
]
