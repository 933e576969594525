"""Settings of the test run."""

import os

# scipy reads it when it is first imported; without it scikit-learn skips its check of array API inputs.
os.environ.setdefault("SCIPY_ARRAY_API", "1")
