"""Records as a WindScanner wind file; `reconstruct.formats.windscanner` reads it back."""

import io

import numpy as np

from reconstruct.formats.text import labview_from_utc
from reconstruct.records import Records


def write_windscanner(records: Records) -> str:
    """Text of a wind file with these records: 8 header fields and 4 numbers for each gate.

    Azimuths are written as they are, the middle of the ray: read the file with `azimuth: stored`, or without
    a scanner file the reader estimates a lead of nothing.

    Examples
    --------
    >>> one = Records(np.array(["2014-05-01"], "datetime64[ns]"), np.ones(1), np.array([179.7]), np.array([5.4]), np.zeros(1),
    ...               np.zeros(1), np.array([1166.0]), np.array([[5.0]]), np.full((1, 1), -12.0))
    >>> write_windscanner(one).strip()
    '0;0;0;0;3481747199.500000;3481747200.500000;179.7000;5.4000;1166.00;5.0000;-12.00;0.00'
    """
    middle = labview_from_utc(records.time_utc)
    half = np.nan_to_num(records.duration_s) / 2
    number = np.arange(records.rays)
    header = [records.scan_id, number, number, number, middle - half, middle + half, records.azimuth_deg]
    formats = ["%d"] * 4 + ["%.6f", "%.6f", "%.4f", "%.4f"]
    columns = [*header, records.elevation_deg]
    width = records.spectral_width_mps
    for gate, range_m in enumerate(records.range_m):
        columns += [
            np.full(records.rays, range_m),
            records.radial_speed_mps[:, gate],
            records.cnr_db[:, gate],
        ]
        columns += [np.zeros(records.rays) if width is None else width[:, gate]]
        formats += ["%.2f", "%.4f", "%.2f", "%.2f"]
    buffer = io.StringIO()
    np.savetxt(buffer, np.column_stack(columns), fmt=formats, delimiter=";")
    return buffer.getvalue()
