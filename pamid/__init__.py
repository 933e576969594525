"""pamid: system identification of pneumatic artificial muscles."""

__version__ = "0.1.0"
