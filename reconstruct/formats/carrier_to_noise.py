"""Signal strength as the files state it, as a carrier-to-noise ratio."""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray


def cnr_from_intensity(intensity: ArrayLike) -> FloatArray:
    """CNR [dB] of an intensity (SNR + 1); NaN where the intensity is not above 1.

    Examples
    --------
    >>> cnr_from_intensity([2.0, 1.01, 0.99]).round(3)
    array([  0., -20.,  nan])
    """
    signal = np.asarray(intensity, dtype=float) - 1.0
    return np.asarray(10.0 * np.log10(np.where(signal > 0, signal, np.nan)))
