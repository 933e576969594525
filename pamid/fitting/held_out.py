r"""What a linear smoother leaves of each block of samples when it is fitted to all others, by one inverse.

.. math:: e_b = (A^{-1})_{bb}^{-1}\,(A^{-1} y)_b, \qquad A = K + \Lambda

with the kernel's Gram matrix K and the penalty or noise Λ on its diagonal: no fit is repeated.

References
----------
C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT Press 2006, section 5.4.2.
"""

import numpy as np


def left_of_blocks(inverse: np.ndarray, y: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return the residual of each block, predicted from all others."""
    left = np.asarray(inverse @ y)
    for block in np.unique(blocks):
        out = np.flatnonzero(blocks == block)
        left[out] = np.linalg.solve(inverse[np.ix_(out, out)], left[out])
    return left
