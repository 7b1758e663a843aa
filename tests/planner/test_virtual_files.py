"""A virtual campaign goes into a database as a whole, or not at all."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from geometry.errors import InputError
from planner import virtual_files
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from planner.simulation import Options
from planner.virtual_files import write_virtual

sa = pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")

SERVER = "LIDARPLAN_TEST_MARIADB"
TABLES = ("scenario", "control", "measurement")
SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 5
lidars:
  - {name: A, position: [447893.983, 6256558.133, 5.078], instrument: windscanner-200s}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 10, accumulation_s: 2, period_s: 24}
wind:
  weibull: {scale_mps: 8.9, shape: 2.75}
  directions_deg: [[118, 270]]
"""


@pytest.fixture(params=["sqlite", "mariadb"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """An empty database outside the campaign's folder."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'shared.sqlite'}"
        return
    if not os.environ.get(SERVER):
        pytest.skip(f"no MariaDB server: set {SERVER} to its SQLAlchemy URL")
    server = os.environ[SERVER]
    emptied(server)
    yield server
    emptied(server)


def emptied(server: str) -> None:
    engine = sa.create_engine(server)
    with engine.begin() as connection:
        for table in (*TABLES, "system"):
            connection.exec_driver_sql(f"DROP TABLE IF EXISTS `{table}`")
    engine.dispose()


def rows(url: str) -> list[int]:
    """Number of rows of each table."""
    engine = sa.create_engine(url)
    with engine.connect() as connection:
        found = [connection.exec_driver_sql(f"SELECT COUNT(*) FROM {name}").scalar() for name in TABLES]
    engine.dispose()
    return found


def simulated(folder: Path, url: str) -> Path:
    """Four periods, in two parts as if a day were two periods long."""
    options = Options(days=4 / 144)
    return write_virtual(Plan(parse_site(SITE)), SITE, folder, options=options, kind="database", url=url)[0]


@pytest.fixture(autouse=True)
def short_days(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual_files, "PERIODS_PER_DAY", 2)


@pytest.mark.parametrize("failure", [KeyboardInterrupt, InputError])
def test_an_interrupted_run_leaves_a_database_as_it_was(
    tmp_path: Path, url: str, monkeypatch: pytest.MonkeyPatch, failure: type[BaseException]
) -> None:
    """The first part is written in full when the second fails; a run before it stays, one after it goes on."""
    simulated(tmp_path / "before", url)
    held = rows(url)
    assert held[0] == 2
    calls: list[int] = []

    def fails(*_: object) -> None:
        calls.append(rows(url)[0])
        if len(calls) == 2:
            raise failure("stop")

    with monkeypatch.context() as patch:
        patch.setattr(virtual_files, "_append_mast", fails)
        with pytest.raises(failure):
            simulated(tmp_path / "broken", url)
    assert len(calls) == 2
    assert rows(url) == held
    assert not (tmp_path / "broken").exists()
    campaign = simulated(tmp_path / "after", url)
    assert rows(url) == [2 * count for count in held]
    assert "scenarios: [3, 4]" in campaign.read_text(encoding="utf-8")


def test_other_readers_see_nothing_of_a_run_before_it_ends(
    tmp_path: Path, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    original = virtual_files._append_mast

    def watched(*given: object) -> None:
        seen.append(rows(url)[0])
        original(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(virtual_files, "_append_mast", watched)
    simulated(tmp_path / "run", url)
    assert seen == [0, 0]
    assert rows(url)[0] == 2
