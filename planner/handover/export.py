"""Everything that a plan hands on, written in one go: all files, or none."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from geometry.errors import InputError
from planner.handover import halo, windscanner
from planner.handover.names import file_stems
from planner.handover.scan_table import scan_table, scan_table_csv
from planner.output import output_folder
from planner.placement.write import PLACES
from planner.plan import Plan
from planner.report_tables import crossing_table, pointing_table
from planner.report_values import Table, csv_text
from planner.scan_layout import ScanLayout
from planner.scan_plans import GatePlan
from planner.site import Site

Kind = Literal["gpkg", "kmz", "geojson", "csv", "halo", "windscanner", "scan-table", "field-sheet"]
KINDS: tuple[Kind, ...] = get_args(Kind)
MAKERS: dict[str, Callable[[Sequence[ScanLayout]], dict[str, str]]] = {
    "halo": halo.halo_files,
    "windscanner": windscanner.windscanner_files,
}
INSTRUMENTS = tuple(MAKERS)


def with_gates(site: Site, gates: GatePlan) -> Site:
    """The site with these range gates for every scan that declares none."""
    scans = (
        scan if scan.gates is not None else scan.model_copy(update={"gates": gates}) for scan in site.scans
    )
    return site.model_copy(update={"scans": tuple(scans)})


class Choice(NamedTuple):
    """The kinds that fit a plan, and why others do not."""

    kinds: tuple[Kind, ...]
    left_out: tuple[str, ...]


def default_kinds(plan: Plan) -> Choice:
    """Choose every kind that the plan has something for: instrument files for the instruments that it has."""
    kinds: list[Kind] = []
    left_out: list[str] = []
    for kind in KINDS:
        reason = _why_not(plan, kind)
        if reason is None:
            kinds.append(kind)
        elif reason:
            left_out.append(f"{kind} is left out: {reason}")
    return Choice(tuple(kinds), tuple(left_out))


def _why_not(plan: Plan, kind: Kind) -> str | None:
    """Why a kind cannot be written; nothing to say ("") where the site has nothing of it, None where it can."""
    if kind in INSTRUMENTS:
        try:
            for layouts in _of_maker(plan, kind).values():
                MAKERS[kind](layouts)
        except InputError as error:
            return str(error)
        return None if _of_maker(plan, kind) else ""
    if kind == "kmz" and plan.site.height_datum == "ellipsoidal" and plan.site.geoid_undulation_m is None:
        return "altitudes above sea level need geoid_undulation_m"
    missing = (kind == "scan-table" and not plan.site.scans) or (
        kind == "field-sheet" and not plan.site.lidars
    )
    return "" if missing else None


def export(
    plan: Plan,
    folder: Path,
    kinds: Sequence[Kind],
    *,
    declination_deg: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Write the files of some kinds into a folder.

    Parameters
    ----------
    plan
        What is planned.
    folder
        Where the files go; they appear there all together, or none of them.
    kinds
        Which.
    declination_deg
        Magnetic declination at the site, east positive [deg]; adds magnetic bearings to the field sheet.
    progress
        Is told what is being done.

    Returns
    -------
    list of Path
        In the order of their names.

    Raises
    ------
    InputError
        If there is nothing of a kind, an instrument cannot do a scan, or the folder cannot be written to.
    """
    with output_folder(folder) as staging:
        for kind in KINDS:
            if kind in kinds:
                progress(f"{plan.site.name}: {kind}")
                _write(plan, staging, kind, declination_deg)
                if kind == "gpkg":
                    _add_places(plan.site, folder, staging / "plan.gpkg")
        written = sorted(path.relative_to(staging) for path in staging.rglob("*") if path.is_file())
    return [folder / path for path in written]


def _write(plan: Plan, folder: Path, kind: Kind, declination_deg: float | None) -> None:
    match kind:
        case "gpkg" | "kmz" | "geojson" | "csv":
            _write_gis(plan, folder, kind)
        case "halo" | "windscanner":
            _write_instrument(plan, folder, kind)
        case "scan-table":
            _require_scans(plan)
            _text(folder / "scan_table.csv", scan_table_csv(plan))
            document = json.dumps(scan_table(plan), ensure_ascii=False, indent=1, allow_nan=False)
            _text(folder / "scan_table.json", document + "\n")
        case "field-sheet":
            from planner.handover.field_sheet import field_sheet_html

            _text(folder / "field_sheet.html", field_sheet_html(plan, declination_deg=declination_deg))


def _write_gis(plan: Plan, folder: Path, kind: Kind) -> None:
    from planner.handover import gis
    from planner.handover.gis_layers import layers, site_layers

    site, made = plan.site, layers(plan)
    if not made:
        raise InputError(f"the site has nothing in it: there is no {kind} to write; add lidars or targets")
    if kind == "gpkg":
        gis.write_geopackage(made, folder / "plan.gpkg")
    elif kind == "kmz":
        gis.write_kmz(made, site, folder / "plan.kmz")
    elif kind == "geojson":
        gis.write_geojson(made, site, folder / "geojson")
    else:
        _text(folder / "layout.csv", gis.layout_csv(site_layers(site), site))
        if "beams" in made:
            _text(folder / "beams.csv", gis.layer_csv(made["beams"]))
        for table in (pointing_table(plan), crossing_table(plan)):
            if table.rows:
                _text(folder / f"{table.name}.csv", _table_csv(table))


def _table_csv(table: Table) -> str:
    return csv_text(table.file_columns, table.file_rows)


def _add_places(site: Site, folder: Path, package: Path) -> None:
    """Put the ranked places that `lidarplan place` has left in the same folder into the GeoPackage too, as a layer."""
    found = folder / PLACES
    if found.is_file() and foreign_places(site, folder) is None:
        import pyogrio

        pyogrio.write_dataframe(
            pyogrio.read_dataframe(found), package, layer="placement", driver="GPKG", append=True
        )


def foreign_places(site: Site, folder: Path) -> str | None:
    """Why the ranked places in a folder are left out: they were found for another site; None where they were not."""
    found = folder / PLACES
    if not found.is_file():
        return None
    import pyogrio
    from pyproj import CRS

    try:
        table = pyogrio.read_dataframe(found)
    except pyogrio.errors.DataSourceError as error:
        return f"{found} is left out: it cannot be read ({error})"
    of = sorted(set(table["site"])) if "site" in table else []
    if of == [site.name] and table.crs == CRS(site.crs):
        return None
    whose = f"{', '.join(of)} ({table.crs.to_string()})" if of else "a site that it does not name"
    return (
        f"{found} is left out: its places were found for {whose}, not for {site.name} ({site.crs}). To have a layer of "
        "places, run `lidarplan place` for this site, or export into its own folder with --out"
    )


def _write_instrument(plan: Plan, folder: Path, kind: Kind) -> None:
    """A folder for each lidar of a make, with its files."""
    by_lidar = _of_maker(plan, kind)
    if not by_lidar:
        have = ", ".join(f"{lidar.name} ({lidar.device.name})" for lidar in plan.site.lidars) or "none"
        raise InputError(
            f"no lidar with a scan is a {kind}: {have}; an instrument's name begins with {kind}, also that of one "
            "that is written as a mapping (name: ...)"
        )
    stems = file_stems(by_lidar)
    for lidar, layouts in by_lidar.items():
        for name, text in MAKERS[kind](layouts).items():
            _text(folder / kind / stems[lidar] / name, text)


def _of_maker(plan: Plan, maker: str) -> dict[str, list[ScanLayout]]:
    """The scans of each lidar of a make."""
    found: dict[str, list[ScanLayout]] = {}
    for layout in plan.layouts:
        if layout.lidar.device.name.lower().startswith(maker):
            found.setdefault(layout.lidar.name, []).append(layout)
    return found


def _require_scans(plan: Plan) -> None:
    if not plan.site.scans:
        raise InputError("the site has no scan: there is no scan table to write; add scans to the site file")


def _text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="")
