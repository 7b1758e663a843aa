"""What is compared: means over ten minutes. The one place for that time and for how many scans fit into one."""

import math

TEN_MINUTES_S = 600.0
"""Averaging time of wind statistics, as in IEC 61400-12-1 and in the reference study [s]."""


def scans_in(period_s: float, averaging_s: float = TEN_MINUTES_S) -> int:
    """Give the number of whole scans of some period [s] in an averaging time [s].

    Examples
    --------
    >>> scans_in(12.1), scans_in(0.1)
    (49, 6000)
    """
    return math.floor(averaging_s / period_s + 1e-9)  # 600 s hold 6000 periods of 0.1 s
