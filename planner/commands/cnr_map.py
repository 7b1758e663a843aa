"""`lidarplan cnr-map plan SITE`, `simulate`, `fit` and `level`: scan hard targets, and learn how the head stands."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.commands.cnr_options import (
    AccumulationOption,
    BeamOption,
    FftOption,
    HeadingOption,
    LidarOption,
    OrderOption,
    PulseOption,
    TargetsOption,
    number,
)
from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say, say_json

if TYPE_CHECKING:
    from planner.cnr_map import MapPlan
    from planner.cnr_simulate import Rehearsal
    from reconstruct.target_choice import Choice

RaysOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for a table of the rays of each map, in head angles."),
]
MapsOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for the maps, one CSV a target, and truth.json.")
]
PlantOption = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="NAME=VALUE,...",
        help="How the head stands, less what the site file says, such as azimuth_offset_deg=0.05,pitch_deg=0.03; "
        "the rest as it says. [default: drawn from the lidar's uncertainty]",
    ),
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Of noise and of the survey's errors.")]


def register(app: typer.Typer) -> None:
    """Add the group of commands to the application."""
    from planner.commands.cnr_map_fit import fit, level

    group = typer.Typer(
        name="cnr-map",
        help="CNR maps of hard targets: plan them, rehearse them, and fit offsets to them.",
        short_help="CNR maps of hard targets: plan, rehearse, fit, level.",
        no_args_is_help=True,
    )
    group.command("plan")(plan)
    group.command("simulate")(simulate)
    group.command("fit")(fit)
    group.command("level")(level)
    app.add_typer(group)


def plan(
    site: SiteArgument,
    lidar: LidarOption,
    target: TargetsOption = None,
    order: OrderOption = "rows",
    accumulation: AccumulationOption = None,
    heading_std: HeadingOption = None,
    beam: BeamOption = 0.1,
    pulse_ns: PulseOption = None,
    fft_points: FftOption = None,
    out: RaysOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Where, how and how long to scan for hard targets.

    Search window, rays, range gates and time of each map, what else stands in it, and which targets fix the head best.
    """
    from typing import get_args

    from planner.cnr_map import choose_targets, plan_map
    from planner.cnr_window import Order
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan

    within("--accumulation", accumulation, 0.0, open_below=True)
    within("--heading-std", heading_std, 0.0, 180.0)
    within("--beam", beam, 0.0, open_below=True)
    within("--pulse-ns", pulse_ns, 0.0, open_below=True)
    places = load_plan(site).exact_places
    choice = choose_targets(places, lidar)
    names = target or (list(choice.names) if choice else [])
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
    if out is not None:
        _write_rays(plans, out)
    if json:
        say_json({"maps": [_map_document(item) for item in plans], "best_targets": _choice_document(choice)})
        return
    _print_plans(plans)
    _print_choice(choice)
    remark(
        "Head angles; the window is three standard deviations of position, levelling, heading and target to each side. "
        "Rows and columns are staggered by parts of a step: --out DIR writes every ray.",
        quiet=quiet,
    )


def simulate(
    site: SiteArgument,
    lidar: LidarOption,
    out: MapsOption,
    target: TargetsOption = None,
    plant: PlantOption = None,
    seed: SeedOption = 0,
    beam: BeamOption = 0.1,
    pulse_ns: PulseOption = None,
    fft_points: FftOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Rehearse the test: maps of a head that is off.

    The planned maps are simulated for a head that stands as is planted, with noise and with errors of the survey, for
    `fit` to find it out.
    """
    from numpy.random import default_rng

    from geometry.errors import InputError
    from planner.cnr_map import choose_targets, solvable_angles
    from planner.cnr_simulate import rehearse
    from planner.commands.choices import within
    from planner.commands.load import load_plan
    from planner.output import require_folder
    from reconstruct.sightings import ANGLES

    within("--beam", beam, 0.0, open_below=True)
    within("--pulse-ns", pulse_ns, 0.0, open_below=True)
    require_folder(out)
    places = load_plan(site).exact_places
    choice = None if target else choose_targets(places, lidar)
    names = target or (list(choice.names) if choice else [])
    if not names:
        raise InputError(
            f"no hard target, mast or turbine is in sight of {lidar} and in reach: there is nothing to map"
        )
    done = rehearse(
        places,
        lidar,
        names,
        rng=default_rng(seed),
        planted=None if plant is None else _planted(plant),
        pulse_ns=pulse_ns,
        fft_points=fft_points,
        beam_width_m=beam,
    )
    document = _write_maps(done, out, seed)
    if json:
        say_json(document)
        return
    for file in document["maps"].values():
        say(str(out / file))
    text = ", ".join(f"{name} {value:+.4f}" for name, value in done.planted.items() if value)
    say(f"Planted, beyond what the site file says: {text or 'nothing'}.")
    files = " ".join(f"'{out / file}'" for file in document["maps"].values())
    fewer = solvable_angles(places, lidar, names)
    solve = "" if fewer in ((), ANGLES) else f" --solve {','.join(fewer)}"
    remark(f"Next: lidarplan cnr-map fit {files} --site {site} --lidar {lidar}{solve}", quiet=quiet)


def _planted(text: str) -> dict[str, float]:
    """NAME=VALUE,... as numbers."""
    from geometry.errors import InputError
    from planner.cnr_simulate import PLANTABLE
    from planner.commands.choices import chosen, within

    planted: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        chosen("--plant", name, PLANTABLE)
        try:
            planted[name] = float(value)
        except ValueError:
            raise InputError(f"--plant {part.strip()} came; allowed: {name}=NUMBER") from None
        within(f"--plant {name}", planted[name], -180.0, 180.0)
    return planted


def _write_maps(done: "Rehearsal", out: Path, seed: int) -> dict[str, Any]:
    """The maps as tables of rays, and what was planted; the document of both."""
    from dataclasses import asdict
    from json import dumps

    from planner.cnr_simulate import map_records
    from planner.handover.names import file_stems
    from planner.output import output_folder
    from reconstruct.record_tables import to_wide

    stems = file_stems(name for name, _ in done.maps)
    document = {
        "lidar": done.lidar.name,
        "seed": seed,
        "planted": done.planted,
        "mounting": asdict(done.mounting),
        "head_off_m": done.head_off_m.tolist(),
        "maps": {name: f"{stems[name]}.csv" for name, _ in done.maps},
    }
    with output_folder(out) as folder:
        for plan, (name, cnr_map) in zip(done.plans, done.maps, strict=True):
            to_wide(map_records(cnr_map, plan)).to_csv(
                folder / f"{stems[name]}.csv", index=False, float_format="%.9g"
            )
        (folder / "truth.json").write_text(
            dumps(document, ensure_ascii=False, indent=1) + "\n", encoding="utf-8"
        )
    return document


def _write_rays(plans: "list[MapPlan]", out: Path) -> None:
    """A table of each map's rays in the order of measurement."""
    from planner.handover.names import file_stems
    from planner.output import output_folder

    stems = file_stems(item.target.name for item in plans)
    with output_folder(out) as folder:
        for item in plans:
            lines = ["map,ray,azimuth_head_deg,elevation_head_deg,accumulation_s"]
            for window in item.windows:
                lines += [
                    f"{window.stage},{ray},{azimuth % 360.0:.4f},{elevation:.4f},{window.accumulation_s:g}"
                    for ray, (azimuth, elevation) in enumerate(zip(*window.rays, strict=True))
                ]
            (folder / f"{stems[item.target.name]}_rays.csv").write_text(
                "\n".join(lines) + "\n", encoding="utf-8"
            )


def _map_document(item: "MapPlan") -> dict[str, Any]:
    from planner.cnr_window import window_record

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
        "ground": None
        if item.ground is None
        else {
            "share": item.ground.share,
            "up_to_head_elevation_deg": number(item.ground.up_to_deg),
            "unknown": item.ground.unknown,
        },
        "notes": list(item.notes),
    }


def _choice_document(choice: "Choice | None") -> dict[str, Any] | None:
    if choice is None:
        return None
    stds = {name: number(std) for name, std in zip(choice.solved, choice.std_deg, strict=True)}
    return {
        "targets": list(choice.names),
        "std_deg": stds,
        "undetermined": list(choice.undetermined),
        "solvable": list(choice.solvable),
        "compared": choice.compared,
        "candidates": choice.candidates,
    }


def _print_plans(plans: "list[MapPlan]") -> None:
    from planner.cnr_window import window_record
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
        if item.ground is not None:
            say(f"{item.target.name}: {_ground_words(item)}.")
        if item.hidden_by:
            say(f"{item.target.name}: {', '.join(item.hidden_by)} may stand before it.")
        for note in item.notes:
            say(f"{item.target.name}: {note}.")


def _ground_words(item: "MapPlan") -> str:
    ground = item.ground
    if ground is None:
        return ""
    outside = "part of the window lies outside the height raster: what is there is not known"
    if not ground.share:
        return outside
    met = (
        f"{100 * ground.share:.0f} % of the rays, up to {ground.up_to_deg:.3f}° head elevation, meet the ground before "
        "the end of the gates"
    )
    return f"{met}; {outside}" if ground.unknown else met


def _print_choice(choice: "Choice | None") -> None:
    if choice is None:
        say("No hard target, mast or turbine is in sight and in reach: the offsets cannot be found by maps.")
        return
    told = zip(choice.solvable, choice.solvable_std_deg, strict=True)
    stds = ", ".join(f"{name} ±{std:.3f}°" for name, std in told) or "no angle"
    say(f"Best targets: {', '.join(choice.names)}; they would give {stds}.")
    if choice.compared < choice.candidates:
        say(
            f"Of {choice.candidates} targets in sight {choice.compared} were compared: the surest in every 30° of bearing, "
            "then the next sure ones."
        )
    if choice.undetermined:
        left = [name for name in choice.solved if name not in choice.solvable]
        say(
            f"Warning: they do not determine {', '.join(choice.undetermined)} together: needed are three targets or more whose "
            "bearings differ widely."
        )
        if choice.solvable:
            say(
                f"To fit what they tell, with {', '.join(left)} as the site file has them: --solve {','.join(choice.solvable)}."
            )
