"""The array types that every room speaks, and positions among them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

__all__ = ["ArrayLike", "BoolArray", "FloatArray", "IntArray", "positions"]


def positions(points_m: ArrayLike, axes: str) -> FloatArray:
    """Check that positions have three coordinates on the last axis.

    Parameters
    ----------
    points_m
        (..., 3) [m].
    axes
        What the coordinates are, for the message.

    Raises
    ------
    InputError
        If the last axis has not three numbers.

    Examples
    --------
    >>> positions([0, 100, 2], "east, north, up").dtype
    dtype('float64')
    """
    points = np.asarray(points_m, dtype=np.float64)
    if points.ndim == 0 or points.shape[-1] != 3:
        raise InputError(
            f"positions of shape {points.shape} came; allowed is (..., 3): {axes} in metres. "
            "Put the three coordinates on the last axis."
        )
    return points
