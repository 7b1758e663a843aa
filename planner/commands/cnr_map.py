"""`lidarplan cnr-map plan SITE` and `fit MAP...`: scan hard targets, and learn from them how the head stands."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say, say_json

if TYPE_CHECKING:
    from planner.cnr_fit import HeadFit
    from planner.cnr_map import MapPlan
    from reconstruct.mounting_fit import Angle
    from reconstruct.target_choice import Choice

LidarOption = Annotated[str, typer.Option("--lidar", metavar="L", help="Name of the lidar.")]
TargetOption = Annotated[
    str | None,
    typer.Option("--target", metavar="T", help="Hard target, mast or turbine. [default: the best three]"),
]
OrderOption = Annotated[str, typer.Option("--order", metavar="rows|columns", help="PPI rows or RHI columns.")]
AccumulationOption = Annotated[
    float | None, typer.Option("--accumulation", metavar="S", help="Of one ray [s]. [default: the least]")
]
HeadingOption = Annotated[
    float | None,
    typer.Option("--heading-std", metavar="DEG", help="How well the heading is known; 180 for not at all."),
]
BeamOption = Annotated[
    float, typer.Option("--beam", metavar="M", help="Diameter of the beam at the target [m].")
]
PulseOption = Annotated[float | None, typer.Option("--pulse-ns", help="Pulse of the maps [ns].")]
FftOption = Annotated[
    int | None, typer.Option("--fft-points", min=1, help="Samples of one gate of the maps.")
]
MapsArgument = Annotated[
    list[str],
    typer.Argument(metavar="MAP...", help="Measured maps, FILE or TARGET=FILE, in the order of time."),
]
SiteOption = Annotated[str, typer.Option("--site", metavar="SITE", help="Site file.")]
SolveOption = Annotated[
    str | None,
    typer.Option(
        "--solve", metavar="NAME,...", help="Angles to solve for. [default: both offsets, pitch, roll]"
    ),
]
WriteOption = Annotated[bool, typer.Option("--write", help="Put the offsets into the site file.")]
FiguresOption = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for a figure of each map.")
]


def register(app: typer.Typer) -> None:
    """Add the group of two commands to the application."""
    group = typer.Typer(
        name="cnr-map",
        help="CNR maps of hard targets: plan them, and fit offsets to them.",
        no_args_is_help=True,
    )
    group.command("plan")(plan)
    group.command("fit")(fit)
    app.add_typer(group)


def plan(
    site: SiteArgument,
    lidar: LidarOption,
    target: TargetOption = None,
    order: OrderOption = "rows",
    accumulation: AccumulationOption = None,
    heading_std: HeadingOption = None,
    beam: BeamOption = 0.1,
    pulse_ns: PulseOption = None,
    fft_points: FftOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Search window, steps, gates and time of a map; and which targets fix the head best."""
    from typing import get_args

    from planner.cnr_map import Order, choose_targets, plan_map
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan

    within("--accumulation", accumulation, 0.0, open_below=True)
    within("--heading-std", heading_std, 0.0, 180.0)
    within("--beam", beam, 0.0, open_below=True)
    within("--pulse-ns", pulse_ns, 0.0, open_below=True)
    places = load_plan(site).exact_places
    choice = choose_targets(places, lidar)
    names = [target] if target is not None else list(choice.names) if choice else []
    lines = chosen("--order", order, get_args(Order))
    plans = [
        plan_map(
            places,
            lidar,
            name,
            order=lines,
            accumulation_s=accumulation,
            heading_std_deg=heading_std,
            beam_width_m=beam,
            pulse_ns=pulse_ns,
            fft_points=fft_points,
        )
        for name in names
    ]
    if json:
        say_json({"maps": [_map_document(item) for item in plans], "best_targets": _choice_document(choice)})
        return
    _print_plans(plans)
    _print_choice(choice)
    remark(
        "Head angles; the window is three standard deviations of position, levelling, heading and target to each side.",
        quiet=quiet,
    )


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
    """Targets in measured maps, and heading, pitch, roll and offsets of the head from them."""
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
    result = fit_head(places, lidar, read_maps(maps), probe=probe, solve=_angles(solve), beam_width_m=beam)
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


def _angles(text: str | None) -> "tuple[Angle, ...]":
    from typing import get_args

    from planner.commands.choices import chosen
    from reconstruct.mounting_fit import ANGLES, Angle

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


def _number(value: float) -> float | None:
    """JSON has no NaN: what is unknown is null."""
    from math import isfinite

    return float(value) if isfinite(value) else None


def _map_document(item: "MapPlan") -> dict[str, Any]:
    from planner.cnr_map import window_record

    seen = item.expected
    return {
        "lidar": item.lidar.name,
        "target": item.target.name,
        "shape": item.target.shape,
        "azimuth_true_deg": float(seen.true.azimuth_deg),
        "azimuth_head_deg": seen.azimuth_head_deg,
        "elevation_deg": float(seen.true.elevation_deg),
        "elevation_head_deg": seen.elevation_head_deg,
        "range_m": float(seen.true.range_m),
        "azimuth_std_deg": seen.azimuth_std_deg,
        "elevation_std_deg": seen.elevation_std_deg,
        "range_std_m": seen.range_std_m,
        "windows": [window_record(window) for window in item.windows],
        "gates": {
            "first_m": item.gates.first_m,
            "spacing_m": item.gates.spacing_m,
            "count": item.gates.count,
        },
        "time_s": item.time_s,
        "others": [
            {"name": other.name, "part": other.part, "range_m": other.range_m, "in_gates": in_gates}
            for other, in_gates in item.others
        ],
        "hidden_by": list(item.hidden_by),
        "notes": list(item.notes),
    }


def _choice_document(choice: "Choice | None") -> dict[str, Any] | None:
    if choice is None:
        return None
    stds = {name: _number(std) for name, std in zip(choice.solved, choice.std_deg, strict=True)}
    return {"targets": list(choice.names), "std_deg": stds, "undetermined": list(choice.undetermined)}


def _print_plans(plans: "list[MapPlan]") -> None:
    from planner.cnr_map import window_record
    from planner.commands.table import print_table

    rows = []
    for item in plans:
        for window in item.windows:
            record = window_record(window)
            rows.append(
                (
                    item.target.name,
                    window.stage,
                    f"{record['azimuth_head_from_deg']:.3f} – {record['azimuth_head_to_deg']:.3f}",
                    f"{record['elevation_head_from_deg']:.3f} – {record['elevation_head_to_deg']:.3f}",
                    f"{record['azimuth_step_deg']:.4f}",
                    f"{record['columns']} x {record['rows']}",
                    f"{item.gates.first_m:.0f} – {item.gates.last_m:.0f}",
                    f"{item.gates.count}",
                    f"{window.time_s / 60:.1f}",
                )
            )
    columns = (
        "target",
        "map",
        "head azimuth °",
        "head elevation °",
        "step °",
        "rays",
        "range m",
        "gates",
        "min",
    )
    print_table("", columns, rows)
    for item in plans:
        for other, in_gates in item.others:
            where = "and in the gates" if in_gates else "outside the gates"
            say(
                f"{item.target.name}: {other.part} of {other.name} is in the window at {other.range_m:.0f} m, {where}."
            )
        if item.hidden_by:
            say(f"{item.target.name}: {', '.join(item.hidden_by)} may stand before it.")
        for note in item.notes:
            say(f"{item.target.name}: {note}.")


def _print_choice(choice: "Choice | None") -> None:
    if choice is None:
        say("No hard target, mast or turbine is in sight and in reach: the offsets cannot be found by maps.")
        return
    stds = ", ".join(f"{name} ±{std:.3f}°" for name, std in zip(choice.solved, choice.std_deg, strict=True))
    say(f"Best targets: {', '.join(choice.names)}; they would give {stds}.")
    if choice.undetermined:
        say(f"Warning: they leave {', '.join(choice.undetermined)} undetermined.")


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
        "range_offset_std_m": _number(fitted.range_std_m),
        "chi_square": fitted.chi_square,
        "freedom": fitted.freedom,
        "targets": [
            {
                "name": item.name,
                "azimuth_head_deg": item.found.azimuth_deg,
                "elevation_head_deg": item.found.elevation_deg,
                "range_head_m": item.found.range_m,
                "azimuth_std_deg": _number(item.found.azimuth_std_deg),
                "elevation_std_deg": _number(item.found.elevation_std_deg),
                "range_std_m": _number(item.found.range_std_m),
                "azimuth_residual_deg": _number(left.azimuth_deg),
                "elevation_residual_deg": _number(left.elevation_deg),
                "range_residual_m": _number(left.range_m),
                "outlier": left.outlier,
            }
            for item, left in zip(result.maps, fitted.residuals, strict=True)
        ],
        "drift": [
            {
                key: _number(value) if isinstance(value, float) else value
                for key, value in drift._asdict().items()
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
    if fitted.outliers:
        say(f"Left out, because the others contradict: {', '.join(fitted.outliers)}.")
    for drift in result.drifts:
        moved = "has moved" if drift.is_significant else "has not moved beyond its uncertainty"
        say(
            f"{drift.target}, first to last of {drift.maps} maps, {moved}: azimuth {drift.azimuth_deg:+.4f}°, "
            f"elevation {drift.elevation_deg:+.4f}°, range {drift.range_m:+.2f} m."
        )
