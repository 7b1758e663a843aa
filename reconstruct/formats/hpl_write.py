"""HALO StreamLine files and the scan schedules that drive the instrument, written and read back."""

import re
from pathlib import Path

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.text import lines_of
from reconstruct.records import Records


def read_schedule(path: Path) -> tuple[FloatArray, FloatArray]:
    """Azimuths and elevations (ray,) [degrees] of a scan schedule: two angles glued together in each line,
    `%07.3f%07.3f`.

    Raises
    ------
    InputError
        If a line is not of that form.
    """
    angles = []
    for number, line in enumerate(lines_of(path), 1):
        if not line.strip():
            continue
        found = re.fullmatch(r"\s*(-?\d+[.,]\d{3})\s*(-?\d+[.,]\d{3})\s*", line)
        if found is None:
            raise InputError(
                f"{path}, line {number}: {line.strip()[:40]!r} is not two angles of the form 039.806014.363"
            )
        angles.append([float(part.replace(",", ".")) for part in found.groups()])
    both = np.array(angles, dtype=float).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def write_schedule(azimuth_deg: FloatArray, elevation_deg: FloatArray) -> str:
    """Text of a scan schedule for azimuths in [0, 360) and elevations [degrees].

    Examples
    --------
    >>> write_schedule(np.array([39.806]), np.array([14.363]))
    '039.806014.363\\n'
    """
    return "".join(f"{a:07.3f}{e:07.3f}\n" for a, e in zip(azimuth_deg, elevation_deg, strict=True))


def write_hpl(records: Records, *, scan_type: str = "User file 1 - stepped") -> str:
    """Text of a HALO file with these records.

    Gates have to be evenly spaced and begin half a gate from the head, as the format has no other; the
    backscatter, which records do not hold, is written as 0.

    Raises
    ------
    InputError
        If the gates are not of that kind or there is no ray.
    """
    length = 2 * float(records.range_m[0]) if records.gates else 0.0
    if not records.rays or not np.allclose(records.range_m, (np.arange(records.gates) + 0.5) * length):
        raise InputError(
            "a .hpl file has gates at (gate + 0.5) lengths and at least one ray: these records do not fit, "
            "store them"
        )
    midnight = records.time_utc[0].astype("datetime64[D]")
    hours = (records.time_utc - midnight) / np.timedelta64(1, "h")
    start = str(records.time_utc[0].astype("datetime64[ms]")).replace("-", "").replace("T", " ")[:-1]
    head = [
        "Filename:\tsimulated.hpl",
        f"System ID:\t{records.instrument.removeprefix('HALO').strip()}",
        f"Number of gates:\t{records.gates}",
        f"Range gate length (m):\t{length:.1f}",
        "Gate length (pts):\t10",
        "Pulses/ray:\t0",
        f"No. of rays in file:\t{records.rays}",
        f"Scan type:\t{scan_type}",
        "Focus range:\t65535",
        f"Start time:\t{start}",
        "Resolution (m/s):\t0.0001",
        "Range of measurement (center of gate) = (range gate + 0.5) * Gate length",
        "Data line 1: Decimal time (hours)  Azimuth (degrees)  Elevation (degrees) Pitch (degrees) Roll "
        "(degrees)",
        "f9.6,1x,f6.2,1x,f6.2",
        "Data line 2: Range Gate  Doppler (m/s)  Intensity (SNR + 1)  Beta (m-1 sr-1)",
        "i3,1x,f6.4,1x,f8.6,1x,e12.6 - repeat for no. gates",
        "****",
    ]
    zero = np.zeros(records.rays)
    pitch, roll = (zero if a is None else a for a in (records.pitch_deg, records.roll_deg))
    intensity = 1.0 + np.where(np.isfinite(records.cnr_db), 10 ** (records.cnr_db / 10), 0.0)
    body = []
    for i in range(records.rays):
        body.append(
            f"{hours[i]:.8f} {records.azimuth_deg[i]:6.2f} {records.elevation_deg[i]:6.2f} {pitch[i]:.2f} "
            f"{roll[i]:.2f}"
        )
        rows = zip(records.radial_speed_mps[i], intensity[i], strict=True)
        body += [f"{g:3d} {speed:.4f} {signal:.6f} 0.000000E+0" for g, (speed, signal) in enumerate(rows)]
    return "\n".join([*head, *body, ""])
