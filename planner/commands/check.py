"""`lidarplan check SITE`: findings."""

import typer

from planner.commands.options import (
    FidelityOption,
    JsonOption,
    QuietOption,
    SiteArgument,
    remark,
    say,
    say_json,
)

KINDS = ("error", "warning", "remark")  # in the order of planner.finding.SEVERITIES


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("check", short_help="Findings about the plan.")(check)


def check(
    site: SiteArgument, fidelity: FidelityOption = None, json: JsonOption = False, quiet: QuietOption = False
) -> None:
    """Findings about the plan; exit code 1 if one of them is an error."""
    from planner.checks import findings
    from planner.commands.load import load_plan
    from planner.commands.table import print_table
    from planner.finding import SEVERITIES, told_once

    plan = load_plan(site, fidelity)
    remark(f"site at {_where(*plan.longitude_latitude_deg)}", quiet=quiet)
    found = findings(plan)
    told_of = told_once(found)
    counts = [sum(finding.severity == severity for finding in told_of) for severity in SEVERITIES]
    if json:
        say_json([finding._asdict() for finding in found])
    elif told_of:
        rows = [(finding.severity, finding.code, finding.subject, finding.text) for finding in told_of]
        print_table("", ("severity", "code", "subject", "finding"), rows, fold="finding")
    else:
        say("Nothing found." if plan.site.scans else "Nothing found, but there are no scans to check.")
    if not plan.site.scans:
        remark("There are no scans: beams, crossings, wakes and times are not checked.", quiet=quiet)
    told = ", ".join(
        f"{count} {kind}{'' if count == 1 else 's'}" for count, kind in zip(counts, KINDS, strict=True)
    )
    remark(f"{told}; docs/findings.md says what each code means.", quiet=quiet)
    if counts[0]:
        raise typer.Exit(1)


def _where(longitude_deg: float, latitude_deg: float) -> str:
    """Latitude and longitude in words: 56.44° N 8.15° E."""
    north, east = "N" if latitude_deg >= 0 else "S", "E" if longitude_deg >= 0 else "W"
    return f"{abs(latitude_deg):.2f}° {north} {abs(longitude_deg):.2f}° {east}"
