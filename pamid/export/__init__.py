"""A fitted model outside Python: C99 without dependencies, ONNX, FMU."""

from .write import TARGETS, export

__all__ = ["TARGETS", "export"]
