r"""What a linear smoother leaves of each block of samples when it is fitted to all others, by one inverse.

.. math:: e_b = (A^{-1})_{bb}^{-1}\,(A^{-1} y)_b, \qquad A = K + \Lambda

with the kernel's Gram matrix K and the penalty or noise Λ on its diagonal: no fit is repeated.

References
----------
C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT Press 2006, section 5.4.2.
"""

from __future__ import annotations

import numpy as np


def left_of_blocks(inverse: np.ndarray, y: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return what is left of each block, predicted from all others.

    Parameters
    ----------
    inverse : ndarray, shape (n_samples, n_samples)
        Inverse of A.
    y : ndarray, shape (n_samples,)
        What is predicted.
    blocks : ndarray of int, shape (n_samples,)
        Which samples are held out together.

    Returns
    -------
    ndarray, shape (n_samples,)
        y less its prediction, in the unit of y.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.fitting.held_out import left_of_blocks
    >>> left_of_blocks(np.eye(3), np.array([1.0, 2.0, 3.0]), np.array([0, 0, 1])).tolist()  # nothing is shared
    [1.0, 2.0, 3.0]
    """
    left = np.asarray(inverse @ y)
    for block in np.unique(blocks):
        out = np.flatnonzero(blocks == block)
        left[out] = np.linalg.solve(inverse[np.ix_(out, out)], left[out])
    return left
