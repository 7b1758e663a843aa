"""Winds from CSV files: what cannot be used is counted."""

from pathlib import Path

import numpy as np

from planner.campaign import MastInput
from planner.mast_file import lost_of, read_mast

ROWS = """when,U,dir
2014-05-01T00:10,8.0,350
2014-05-01T00:20,calm,10
yesterday,7.0,20
2014-05-01T00:30,9999,30
2014-05-01T00:40,,n/a
"""


def test_what_a_mast_file_loses_is_told(tmp_path: Path) -> None:
    """One row has no time, one speed is a word; a stated marker and an empty cell are no loss."""
    path = tmp_path / "mast.csv"
    path.write_text(ROWS, encoding="utf-8")
    mast = MastInput.model_validate({"path": str(path), "time": "when", "speed": "U", "direction": "dir"})
    found = read_mast(mast)
    assert np.isfinite(found.u_mps).tolist() == [True, False, False, False]
    told = lost_of(str(path), ",", "when", ("U", "dir"))
    assert told == "lost of mast.csv: rows without a time: 1, cells of U that are no number: 1"
    path.write_text(ROWS.replace("calm", "6").replace("yesterday", "2014-05-01T00:25"), encoding="utf-8")
    assert lost_of(str(path), ",", "when", ("U", "dir")) == ""
