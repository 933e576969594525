"""What a fit of named parameters within bounds leaves."""

from __future__ import annotations

from sklearn.utils.validation import check_is_fitted


class BoundedFit:
    """Parameters by name, each fitted or held, with units and errors.

    Attributes
    ----------
    parameters_ : dict of str to float
        Every parameter, fitted or held, SI units.
    standard_errors_ : dict of str to float
        Their standard errors: 0 for a held parameter, infinite for one that the data do not determine or that lies
        on a bound. With `groups`, cluster-robust.
    units_ : dict of str to str
        Their units.
    fitted_names_ : list of str
        The parameters that were fitted, in the order of `covariance_`.
    covariance_ : ndarray, shape (n_fitted, n_fitted)
        Covariance of the fitted parameters.
    at_bound_ : list of str
        Fitted parameters that lie on a bound.
    n_iter_ : int
        Evaluations used.
    """

    fitted_names_: list[str]

    @property
    def n_parameters_(self) -> int:
        """Number of fitted parameters."""
        check_is_fitted(self, "fitted_names_")
        return len(self.fitted_names_)
