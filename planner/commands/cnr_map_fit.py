"""`lidarplan cnr-map fit MAP...` and `level SCAN...`: learn from hard targets, or the sea, how the head stands."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.commands.cnr_options import (
    BeamOption,
    FftOption,
    LidarOption,
    PulseOption,
    SiteOption,
    WriteOption,
    number,
)
from planner.commands.options import JsonOption, QuietOption, remark, say, say_json

if TYPE_CHECKING:
    from planner.cnr_fit import Drift, HeadFit
    from planner.sea_fit import SeaFit
    from reconstruct.mounting_fit import MountingFit
    from reconstruct.sea_level import Level
    from reconstruct.sightings import Angle

MapsArgument = Annotated[
    list[str],
    typer.Argument(metavar="MAP...", help="Measured maps, FILE or TARGET=FILE, in the order of time."),
]
SolveOption = Annotated[
    str | None,
    typer.Option(
        "--solve", metavar="NAME,...", help="Angles to solve for. [default: both offsets, pitch, roll]"
    ),
]
SeaMapsArgument = Annotated[
    list[str], typer.Argument(metavar="SCAN...", help="Measured rays of low scans over water.")
]
SeaHeightOption = Annotated[
    float,
    typer.Option("--sea-height", metavar="M", help="Sea of the moment above mean sea level: the tide [m]."),
]
SeaStdOption = Annotated[
    float, typer.Option("--sea-std", metavar="M", help="Standard deviation of that [m]; 0 takes it as it is.")
]
OffsetOption = Annotated[
    bool, typer.Option("--solve-offset", help="Solve for the elevation offset too: needs two elevations.")
]
FiguresOption = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for a figure of each map.")
]


def fit(
    maps: MapsArgument,
    site: SiteOption,
    lidar: LidarOption,
    solve: SolveOption = None,
    write: WriteOption = False,
    out: FiguresOption = None,
    beam: BeamOption = 0.1,
    pulse_ns: PulseOption = None,
    fft_points: FftOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Offsets, pitch and roll from measured maps.

    Finds the target in each map, then how the head stands; names targets that contradict the others, and what has moved
    between repeated maps. Nothing is written without --write, nor where the targets do not determine what is asked.
    """
    from geometry.errors import InputError
    from planner.cnr_fit import fit_head, read_maps, site_keys
    from planner.cnr_map import map_probe
    from planner.commands.choices import within
    from planner.commands.load import load_plan
    from planner.files.yaml_edit import write_lidar

    if write and site == "-":
        raise InputError("--write needs a site file to write to, not standard input")
    within("--beam", beam, 0.0, open_below=True)
    within("--pulse-ns", pulse_ns, 0.0, open_below=True)
    places = load_plan(site).exact_places
    probe = map_probe(places.site.lidar(lidar), pulse_ns, fft_points)
    result = fit_head(
        places, lidar, read_maps(maps, places.site), probe=probe, solve=_angles(solve), beam_width_m=beam
    )
    if out is not None:
        _draw(result, out, probe.length_m)
    if write:
        write_lidar(Path(site), lidar, site_keys(result))
    if json:
        say_json(_fit_document(result, written=write))
        return
    _print_fit(result)
    if write:
        remark(f"{site} has the new offsets; `lidarplan point` uses them.", quiet=quiet)


def level(
    scans: SeaMapsArgument,
    site: SiteOption,
    lidar: LidarOption,
    sea_height: SeaHeightOption = 0.0,
    sea_std: SeaStdOption = 0.1,
    solve_offset: OffsetOption = False,
    write: WriteOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Pitch and roll from low scans over the sea.

    The range at which a low beam meets the water tells how the head is tilted. Offsets of the site file are applied
    first; scan bearings as far apart as the water allows.
    """
    from geometry.errors import InputError
    from planner.commands.choices import within
    from planner.commands.load import load_plan
    from planner.files.yaml_edit import write_lidar
    from planner.sea_fit import level_head, sea_keys
    from reconstruct.formats.reading import read

    if write and site == "-":
        raise InputError("--write needs a site file to write to, not standard input")
    within("--sea-height", sea_height)
    within("--sea-std", sea_std, 0.0)
    result = level_head(
        load_plan(site).exact_places,
        lidar,
        [(path, read(path)) for path in scans],
        sea_height_m=sea_height,
        sea_std_m=sea_std,
        solve_offset=solve_offset,
    )
    if write:
        write_lidar(Path(site), lidar, sea_keys(result))
    if json:
        say_json(_level_document(result, written=write))
        return
    _print_level(result)
    if write:
        remark(f"{site} has the new tilt; `lidarplan point` uses it.", quiet=quiet)


def _level_rows(result: "SeaFit") -> list[tuple[str, float, float, float]]:
    """Name, before, found and standard deviation of what was solved for."""
    found, before = result.level, result.before
    rows = [
        ("pitch_deg", before.pitch_deg, found.pitch_deg, found.pitch_std_deg),
        ("roll_deg", before.roll_deg, found.roll_deg, found.roll_std_deg),
    ]
    if result.offset_solved:
        offset = before.elevation_offset_deg
        new = offset + found.elevation_offset_deg
        rows.append(("elevation_offset_deg", offset, new, found.elevation_offset_std_deg))
    return rows


def _level_document(result: "SeaFit", *, written: bool) -> dict[str, Any]:
    from planner.sea_fit import sea_keys

    return {
        "lidar": result.lidar.name,
        "angles": [
            {"name": name, "before_deg": before, "value_deg": value, "std_deg": std}
            for name, before, value, std in _level_rows(result)
        ],
        "height_above_sea_m": result.level.height_m,
        "height_std_m": result.level.height_std_m,
        "range_residual_std_m": result.level.residual_std_m,
        "rays": result.rays,
        "rays_on_sea": result.level.rays,
        "site_keys": sea_keys(result),
        "written": written,
    }


def _print_level(result: "SeaFit") -> None:
    from planner.commands.table import print_table

    rows = [
        (name.removesuffix("_deg").replace("_", " ") + " °", f"{before:.4f}", f"{value:.4f}", f"{std:.4f}")
        for name, before, value, std in _level_rows(result)
    ]
    print_table(f"{result.lidar.name}, nose up and right side down", ("", "before", "found", "std"), rows)
    found = result.level
    say(
        f"{found.rays} of {result.rays} rays meet the sea; ranges are left over by {found.residual_std_m:.1f} m (standard "
        f"deviation). Height of the head above the sea: {result.height_m:.2f} m by the site file and --sea-height, "
        f"{_fitted_height(found)} fit."
    )


def _fitted_height(found: "Level") -> str:
    if not found.height_std_m:
        return "taken as it is by the"
    return f"{found.height_m:.2f} ± {found.height_std_m:.2f} m by the"


def _angles(text: str | None) -> "tuple[Angle, ...]":
    from typing import get_args

    from planner.commands.choices import chosen
    from reconstruct.sightings import ANGLES, Angle

    allowed: tuple[Angle, ...] = get_args(Angle)
    if text is None:
        return ANGLES
    return tuple(chosen("--solve", part.strip(), allowed) for part in text.split(","))


def _draw(result: "HeadFit", out: Path, probe_m: float) -> None:
    from planner.figures.cnr_map import cnr_map_figure
    from planner.output import output_folder

    with output_folder(out) as folder:
        for number, item in enumerate(result.maps, start=1):
            (folder / f"cnr-map-{number}.png").write_bytes(cnr_map_figure(item, probe_m))


def _fit_document(result: "HeadFit", *, written: bool) -> dict[str, Any]:
    from planner.cnr_fit import site_keys

    fitted = result.fit
    return {
        "lidar": result.lidar.name,
        "angles": [
            {
                "name": angle,
                "before_deg": getattr(result.before, angle),
                "value_deg": getattr(fitted.mounting, angle),
                "std_deg": fitted.std_deg(angle),
                "significant": fitted.is_significant(angle, getattr(result.before, angle)),
            }
            for angle in fitted.solved
        ],
        "covariance_deg2": fitted.covariance_deg2.tolist(),
        "range_offset_m": fitted.mounting.range_offset_m,
        "range_offset_std_m": number(fitted.range_std_m),
        "chi_square": fitted.chi_square,
        "freedom": fitted.freedom,
        "significant_from_std": fitted.coverage_factor,
        "targets": [
            {
                "name": item.name,
                "azimuth_head_deg": item.found.azimuth_deg,
                "elevation_head_deg": item.found.elevation_deg,
                "range_head_m": item.found.range_m,
                "azimuth_std_deg": number(item.found.azimuth_std_deg),
                "elevation_std_deg": number(item.found.elevation_std_deg),
                "range_std_m": number(item.found.range_std_m),
                "azimuth_residual_deg": number(left.azimuth_deg),
                "elevation_residual_deg": number(left.elevation_deg),
                "range_residual_m": number(left.range_m),
                "outlier": left.outlier,
            }
            for item, left in zip(result.maps, fitted.residuals, strict=True)
        ],
        "drift": [
            {
                key: number(value) if isinstance(value, float) else value
                for key, value in (*drift._asdict().items(), ("chance", drift.chance))
            }
            for drift in result.drifts
        ],
        "site_keys": site_keys(result),
        "written": written,
    }


def _print_fit(result: "HeadFit") -> None:
    from planner.commands.table import print_table

    fitted = result.fit
    rows = [
        (
            angle.removesuffix("_deg").replace("_", " ") + " °",
            f"{getattr(result.before, angle):.4f}",
            f"{getattr(fitted.mounting, angle):.4f}",
            f"{fitted.std_deg(angle):.4f}",
            "yes" if fitted.is_significant(angle, getattr(result.before, angle)) else "no",
        )
        for angle in fitted.solved
    ]
    offset = fitted.mounting.range_offset_m
    rows.append(
        (
            "range offset m",
            f"{result.before.range_offset_m:.2f}",
            f"{offset:.2f}",
            f"{fitted.range_std_m:.2f}",
            "–",
        )
    )
    print_table(f"{result.lidar.name}", ("", "before", "found", "std", "change significant"), rows)
    left = [
        (
            item.name,
            *(f"{value:+.4f}".replace("+nan", "–") for value in (item.azimuth_deg, item.elevation_deg)),
            f"{item.range_m:+.2f}".replace("+nan", "–"),
            "left out" if item.outlier else "",
        )
        for item in fitted.residuals
    ]
    print_table("left over", ("target", "azimuth °", "elevation °", "range m", ""), left)
    say(_significance_words(fitted))
    if fitted.outliers:
        say(f"Left out, because the others contradict: {', '.join(fitted.outliers)}.")
    for drift in result.drifts:
        say(_drift_words(drift))


def _significance_words(fitted: "MountingFit") -> str:
    left = (
        f"{fitted.freedom} angle{'' if fitted.freedom == 1 else 's'} left over"
        if fitted.freedom
        else "no angle left over"
    )
    return (
        f"A change is called significant from {fitted.coverage_factor:.2g} standard deviations on (5 %, Student): {left} "
        "to check the stated uncertainties by."
    )


def _drift_words(drift: "Drift") -> str:
    """What moved from the first to the last map, and how likely that is where nothing has."""
    told = ", ".join(
        f"{name} {moved:+.{digits}f} ± {std:.{digits}f} {unit}"
        for name, moved, std, digits, unit in (
            ("azimuth", drift.azimuth_deg, drift.azimuth_std_deg, 4, "°"),
            ("elevation", drift.elevation_deg, drift.elevation_std_deg, 4, "°"),
            ("range", drift.range_m, drift.range_std_m, 2, "m"),
        )
        if moved == moved
    )
    verdict = "it has moved" if drift.is_significant else "no drift beyond the uncertainty"
    chance = "under 0.1 %" if drift.chance < 1e-3 else f"{100 * drift.chance:.2g} %"
    return (
        f"{drift.target}, first to last of {drift.maps} maps: {told}; {verdict} (chance of that much without any drift: "
        f"{chance})."
    )
