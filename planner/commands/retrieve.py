"""`lidarplan retrieve CAMPAIGN`: measured or simulated rays to the wind of every scan, and its means."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, remark, say, say_json

if TYPE_CHECKING:
    from planner.analysis_files import Retrieved

CampaignArgument = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file.")]
ResultsOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for the results. [default: the campaign's `output`]"),
]
RestartOption = Annotated[bool, typer.Option("--restart", help="Forget what an unfinished run has done.")]
InteractiveOption = Annotated[
    bool,
    typer.Option(
        "--interactive", help="Show the unfiltered rays and ask for limits until they are approved."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("retrieve", short_help="Measured rays to wind of scans and of 1 and 10 minutes.")(retrieve)


def retrieve(
    campaign: CampaignArgument,
    out: ResultsOption = None,
    interactive: InteractiveOption = False,
    restart: RestartOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Filter, retrieve and average a campaign's rays; write single scans and means as CSV and Parquet."""
    from planner.analysis import retrieve as run
    from planner.commands.progress import shown
    from planner.files.yaml_campaign import load_campaign

    loaded = load_campaign(campaign)
    if out is not None:
        loaded = loaded._replace(campaign=loaded.campaign.model_copy(update={"output": out}))
    if interactive:
        from planner.commands.ask_limits import asked

        loaded = loaded._replace(campaign=asked(loaded))
    with shown("retrieving the wind", quiet=quiet) as progress:
        found = run(loaded, restart=restart, progress=progress)
    if json:
        say_json(_document(found))
        return
    if found.resumed:
        remark(f"{found.resumed} parts had been done by an earlier run.", quiet=quiet)
    _print(found, quiet=quiet)
    say(str(found.folder))


def _print(found: "Retrieved", *, quiet: bool) -> None:
    from planner.analysis_files import scan_lines
    from planner.clocks import told_trims
    from planner.commands.table import print_table

    for scan in found.steps:
        for line in scan_lines(found, scan):
            remark(f"{scan}: {line}", quiet=quiet)
    for line in told_trims(found.sonics):
        remark(line, quiet=quiet)
    for pair, gaps in found.gaps.items():
        if gaps:
            rows = [
                (f"{g.gap_s:g}", str(g.pairs), f"{g.share:.1%}", f"{g.mean_gap_s:.2f}", f"{g.spread_mps:.3f}")
                for g in gaps
            ]
            heads = ("longest gap s", "pairs", "of the rays", "mean gap s", "std in 10 min m/s")
            print_table(f"{pair}: rays paired within a time gap", heads, rows)
    for period_s, count in found.means.items():
        remark(f"means_{period_s:g}s: {count} rows", quiet=quiet)


def _document(found: "Retrieved") -> dict[str, object]:
    return {
        "results": str(found.folder),
        "filters": {scan: [step._asdict() for step in steps] for scan, steps in found.steps.items()},
        "without_wind": {scan: lost for scan, lost in found.lost.items() if lost},
        "radial_speeds_alone": list(found.alone),
        "gaps": {
            pair: [
                {
                    "gap_s": g.gap_s,
                    "pairs": g.pairs,
                    "share": g.share,
                    "mean_gap_s": _known(g.mean_gap_s),
                    "std_in_10min_mps": _known(g.spread_mps),
                }
                for g in gaps
            ]
            for pair, gaps in found.gaps.items()
        },
        "attitude": {
            scan: {
                name: {key: _known(value) for key, value in drift._asdict().items()}
                for name, drift in logged.drifts.items()
            }
            for scan, logged in found.drifts.items()
        },
        "clocks": {
            scan: {key: _known(value) for key, value in lag._asdict().items()}
            for scan, lag in found.clocks.items()
        },
        "sonics": {
            name: {
                "scan": each.scan,
                "trim_deg": _known(each.trim.trim_deg),
                "mismatch_before_mps": _known(each.trim.before_mps),
                "mismatch_after_mps": _known(each.trim.after_mps),
                "lag_s": _known(each.lag.lag_s),
            }
            for name, each in found.sonics.items()
        },
        "means": {f"{period_s:g}": rows for period_s, rows in found.means.items()},
    }


def _known(value: object) -> object:
    """A number, or null where it is not known."""
    return None if value != value else value
