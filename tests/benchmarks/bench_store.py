"""Memory of a retrieval from the store, however long the campaign; speed of reading from DuckDB and MariaDB.

Run: python tests/benchmarks/bench_store.py [--days 2], from the root. LIDARPLAN_TEST_MARIADB names a server to try, an
empty database as SQLAlchemy writes it; without it an SQLite file stands in.

Memory is what the system says of a process of its own at its largest (VmHWM), everything imported included.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from geometry.beams import unit_vector  # noqa: E402
from planner.files.yaml_site import load_site  # noqa: E402
from planner.plan import Plan  # noqa: E402
from reconstruct.records import Records  # noqa: E402
from reconstruct.store import read_store, write_store  # noqa: E402

Kind = Literal["sector", "stare"]

SITE = """\
name: bench
crs: EPSG:32632
ground_height_m: 4.8
lidars:
  - {name: S, position: [447893.983, 6256558.133, 5.078], instrument: windscanner-200s}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120.0}
scans:
  - {name: sector, lidar: S, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4, period_s: 12}
  - {name: stare, lidar: S, target: cup, type: stare, accumulation_s: 0.4}
"""
CAMPAIGN = """\
name: bench
site: site.yaml
inputs: [{{scan: {scan}, path: rays.duckdb}}]
chunk_rays: {chunk_rays}
"""
START = np.datetime64("2014-04-30", "ns")
RAYS_A_DAY = 216_000  # of 0.4 s each
SPEED_MPS, FROM_DEG, TURBULENCE_MPS = 8.0, 200.0, 0.7
FIRST_GATE_M, GATE_M = 666.0, 25.0

MEASURE = """
import sys, time
sys.path.insert(0, {root!r})
{imports}
for work in {works!r}:
    start = time.process_time()
    exec(work)
    seconds = time.process_time() - start
    peak = next(line.split()[1] for line in open("/proc/self/status", encoding="ascii") if line.startswith("VmHWM"))
    print(int(peak) / 1024, seconds)
"""


class Spent(NamedTuple):
    """What a process of its own took."""

    peak_mb: float
    cpu_s: float


def write_campaign(
    folder: Path, kind: Kind, rays: int, *, gates: int = 41, chunk_rays: int = 200_000, seed: int = 1
) -> Path:
    """A synthetic campaign in a store, made a tenth of a day at a time; its campaign file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    rng = np.random.default_rng(seed)
    for records in synthetic(folder / "site.yaml", kind, rays, gates, rng):
        write_store(folder / "rays.duckdb", records)
    path = folder / "campaign.yaml"
    path.write_text(CAMPAIGN.format(scan=kind, chunk_rays=chunk_rays), encoding="utf-8")
    return path


def synthetic(
    site: Path, kind: Kind, rays: int, gates: int, rng: np.random.Generator, *, tenth: bool = False
) -> Iterator[Records]:
    """Rays of a wind with white turbulence, in pieces; with `tenth` a tenth of them is missing."""
    scan = Plan(load_site(site)).layout[kind].scan
    piece = 21_600  # whole sweeps
    for begin in range(0, rays, piece):
        number = np.arange(begin, min(begin + piece, rays))
        sweep, place = np.divmod(number, scan.count)
        ray = np.where(sweep % 2 == 0, place, scan.count - 1 - place)
        azimuth, elevation = scan.azimuth_deg[ray], scan.elevation_deg[ray]
        along = unit_vector(azimuth, elevation) @ (-SPEED_MPS * unit_vector(FROM_DEG, 0.0))
        speed = along[:, None] + rng.normal(0, TURBULENCE_MPS, (len(number), gates))
        if tenth:
            speed[rng.random(speed.shape) < 0.1] = np.nan
        yield Records(
            time_utc=START + (number * 400).astype("timedelta64[ms]"),
            duration_s=np.full(len(number), 0.4),
            azimuth_deg=azimuth,
            elevation_deg=elevation,
            scan_id=np.zeros(len(number)),
            sweep_id=sweep if scan.count > 1 else np.zeros(len(number)),
            range_m=FIRST_GATE_M + GATE_M * np.arange(gates),
            radial_speed_mps=speed,
            cnr_db=rng.normal(-12, 1, (len(number), gates)),
            instrument="S",
        )


def spent(imports: str, *works: str) -> list[Spent]:
    """Run some lines after each other in a process of their own: what each took, and the peak up to its end."""
    code = MEASURE.format(root=str(ROOT), imports=imports, works=works)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    return [Spent(*(float(part) for part in line.split())) for line in done.stdout.splitlines()]


def retrievals(*paths: Path) -> list[Spent]:
    """`retrieve` of campaigns after each other."""
    imports = "from planner.analysis import retrieve\nfrom planner.files.yaml_campaign import load_campaign"
    return spent(imports, *(f"retrieve(load_campaign({str(path)!r}))" for path in paths))


def bench_retrieval_memory(folder: Path, days: float) -> None:
    """A campaign and one four times as long."""
    for kind in ("sector", "stare"):
        results = []
        for times in (1, 4):
            path = write_campaign(folder / f"{kind}{times}", kind, round(days * times * RAYS_A_DAY))  # type: ignore[arg-type]
            (found,) = retrievals(path)
            results.append(found)
            size_mb = (path.parent / "rays.duckdb").stat().st_size / 1e6
            print(
                f"{kind}, {days * times:g} days, store of {size_mb:.0f} MB: peak {found.peak_mb:.0f} MB (limit 1000), "
                f"{found.cpu_s:.1f} s of processor"
            )
        one, four = results
        print(f"{kind}: four times as long takes {four.peak_mb / one.peak_mb:.2f} x the memory")


def bench_duckdb_read(folder: Path) -> None:
    """Ten million radial speeds with their CNR into arrays."""
    path = folder / "read.duckdb"
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    for records in synthetic(folder / "site.yaml", "sector", 243_900, 41, np.random.default_rng(2)):
        write_store(path, records)
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        records = read_store(path)
        seconds.append(time.perf_counter() - start)
    values = records.radial_speed_mps
    start = time.perf_counter()
    values.copy()
    copy_s = time.perf_counter() - start
    print(
        f"DuckDB read of {values.size / 1e6:.1f}e6 rows: {min(seconds):.2f} s (limit 2), "
        f"{min(seconds) / copy_s:.0f} x copying its array"
    )


def bench_database(folder: Path) -> None:
    """The four tables, read in chunks: MariaDB where there is a server, else SQLite."""
    from reconstruct.formats.aas_write import write_aas

    url = os.environ.get("LIDARPLAN_TEST_MARIADB")
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    results = []
    for times in (1, 4):
        place = url or str(folder / f"rays{times}.sqlite")
        for number, records in enumerate(
            synthetic(folder / "site.yaml", "stare", times * 43_200, 10, np.random.default_rng(3))
        ):
            scenario = 1000 * times + number if url else number + 1
            write_aas(
                Records(**{**vars(records), "scan_id": np.full(records.rays, scenario)}),
                place,
                scan_type="LOS",
            )
        numbers = [1000 * times + number if url else number + 1 for number in range(times * 2)]
        work = (
            "rows = sum(chunk.radial_speed_mps.size for number in NUMBERS\n"
            "    for chunk in aas_chunks(PLACE, Options(scenario=number), rays=5000))"
        )
        imports = (
            "from reconstruct.formats.aas_database import aas_chunks\nfrom reconstruct.formats.options import Options\n"
            f"NUMBERS, PLACE = {numbers!r}, {place!r}"
        )
        (found,) = spent(imports, work)
        results.append(found)
        print(
            f"{'MariaDB' if url else 'SQLite'}, {times * 432_000} rows read in chunks: peak {found.peak_mb:.0f} MB, "
            f"{found.cpu_s:.1f} s of processor"
        )
    print(f"four times as many rows take {results[1].peak_mb / results[0].peak_mb:.2f} x the memory")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=float, default=2.0, help="length of the shorter campaign [2]")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as where:
        bench_duckdb_read(Path(where))
        bench_database(Path(where))
        bench_retrieval_memory(Path(where), asked.days)
