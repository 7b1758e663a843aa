"""Whether a measured number and a predicted one agree, by the standard errors of both."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

AGREES = 2.0  # standard errors: chance alone is farther off in one case of twenty


class Difference(NamedTuple):
    """A measured number beside the predicted one."""

    apart: float  # measured less predicted
    standard_error: float  # of both together
    ratio: float  # apart over its standard error; NaN where that is not known

    @property
    def agrees(self) -> bool | None:
        """Whether they are no more than two standard errors apart; None where that is not known."""
        return None if np.isnan(self.ratio) else abs(self.ratio) <= AGREES


def set_beside(
    measured: float | None, predicted: float | None, *, errors: Sequence[float | None] = ()
) -> Difference | None:
    """Set a measured number beside a predicted one.

    Parameters
    ----------
    measured, predicted : float or None
        In the same unit; None or NaN: not known.
    errors : sequence of float or None
        Standard errors of either, independent of each other; None: that there is none.

    Returns
    -------
    Difference or None
        None where one of the numbers is not known.

    Examples
    --------
    >>> found = set_beside(0.990, 0.985, errors=(0.004, 0.003))
    >>> round(found.apart, 6), round(found.standard_error, 6), round(found.ratio, 6), found.agrees
    (0.005, 0.005, 1.0, True)
    """
    if measured is None or predicted is None or np.isnan(measured) or np.isnan(predicted):
        return None
    both = float(np.sqrt(np.sum(np.square([0.0 if error is None else error for error in errors]))))
    apart = measured - predicted
    return Difference(apart, both, apart / both if both > 0 else float("nan"))
