"""The report: everything about one site, or two side by side, on one page, and its tables as CSV.

Names in a site file are untrusted text. Every one reaches the page through the template's escaping; the
page's content security policy forbids loading anything and runs only the scripts whose digests it lists, so
that a script in a name would not run even if it got there.
"""

from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from re import DOTALL, findall

from markupsafe import Markup

from geometry.errors import UnavailableError
from planner import palette
from planner.assumptions import assumptions
from planner.checks import findings
from planner.error_entry import Entry, error_entries
from planner.error_nouns import ErrorCurve
from planner.exclusion import Exclusion
from planner.figures.canvas import DPI
from planner.figures.map_layers import most_lost
from planner.figures.sector_error import sector_error
from planner.figures.site_map import site_map
from planner.figures.tradeoff import tradeoff_figure
from planner.figures.wake_rose import wake_rose
from planner.finding import Finding, told_once
from planner.handover.field_sheet import sheet_html, sheet_style
from planner.output import output_folder
from planner.plan import Plan
from planner.plan_scene import plan_scene
from planner.report_errors import tier_curve
from planner.report_numbers import MISSES, KeyNumber, finding_counts, key_numbers
from planner.report_site import made_line, position_table, wind_table
from planner.report_tables import (
    budget_table,
    crossing_table,
    directions,
    errors_table,
    fidelity_table,
    findings_table,
    pair_table,
    pointing_table,
    scan_table,
    size_table,
    terrain_table,
    unknown_numbers,
    wake_table,
)
from planner.report_values import DASH, Column, Table, csv_text, percent, quantity
from planner.scene import Scene, opengl
from planner.site import Site
from planner.tradeoff import Trade

PAGE = "report.html"
SITE_COLUMN = Column("site", "site")
PICTURE_PX = (1280, 800)
SCREEN_DPI = 96  # of a style sheet's pixels; figures have more, for paper and fine screens

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class SiteReport:
    """What the page says about one site; each part is made when first asked for, and once."""

    plan: Plan
    number: int  # on the page, from 1
    trades: Sequence[Trade] = ()  # measured beforehand, or none
    predicted: Callable[[], Sequence[ErrorCurve]] | None = (
        None  # errors from another process; None: made here
    )

    @cached_property
    def findings(self) -> list[Finding]:
        """Errors first, each told once with all its subjects."""
        return told_once(findings(self.plan))

    @cached_property
    def errors(self) -> list[Entry]:
        """Every predicted curve."""
        if self.predicted is None:
            return error_entries(self.plan, self.plan.default_errors)
        return error_entries(self.plan, [*self.predicted(), *self.pair_errors])

    @cached_property
    def pair_errors(self) -> Sequence[ErrorCurve]:
        """Errors of the pairs, which are predicted here while a child process predicts the sectors."""
        return self.plan.predicted.pair_errors()

    @cached_property
    def numbers(self) -> list[KeyNumber]:
        """What a reader looks for first."""
        return key_numbers(self.plan, self.findings, self.errors)

    @cached_property
    def tables(self) -> dict[str, Table]:
        """The tables, by name."""
        made = (
            findings_table(self.findings),
            pointing_table(self.plan),
            crossing_table(self.plan),
            wake_table(self.plan),
            errors_table(self.errors),
            scan_table(self.plan),
            fidelity_table(self.plan.fidelity),
            position_table(self.plan),
            wind_table(self.plan),
            terrain_table(self.plan),
        )
        return {table.name: table for table in made}

    @cached_property
    def scene(self) -> Scene:
        """The 3-D scene."""
        return plan_scene(self.plan)

    def draw(self) -> None:
        """Make now all that does not wait for the sectors' errors."""
        _ = (self.pictures, self.findings, self.plan.fidelity, self.plan.budgets)
        if self.predicted is not None:
            _ = self.pair_errors

    @cached_property
    def pictures(self) -> dict[str, object]:
        """What is drawn and needs no prediction: map, roses and scene."""
        return {"map": site_map(self.plan), "rose": wake_rose(self.plan), **_scene_part(self)}


CSV_TABLES = ("pointing", "findings", "wakes", "crossings", "errors", "terrain")
OF_TERRAIN = ("terrain",)  # written only where a site has one


def write_report(
    plans: Sequence[Plan],
    folder: Path,
    *,
    trades: Sequence[Sequence[Trade]] = (),
    aside: bool = False,
    progress: Progress = lambda _: None,
) -> list[Path]:
    """Write the report of one or two plans: `report.html` and its tables as CSV.

    Parameters
    ----------
    plans
        One, or two to be compared.
    folder
        Where the files go; they appear there all together, or none of them.
    trades
        For each plan what `Plan.trades` measured; without it the page says how to measure it.
    aside
        Predict errors in a process of their own while this one draws. A script that calls this needs the usual
        `if __name__ == "__main__":` then.
    progress
        Is told what is being done.

    Returns
    -------
    list of Path
        The page, then the tables.

    Raises
    ------
    InputError
        If the folder cannot be written to, or a plan's numbers make no report.
    """
    measured = list(trades) or [()] * len(plans)
    with output_folder(folder) as staging, _asking_for_opengl(), _predicting(plans, aside=aside) as predicted:
        reports = [
            SiteReport(plan, number, rows, curves)
            for number, (plan, rows, curves) in enumerate(
                zip(plans, measured, predicted, strict=True), start=1
            )
        ]
        for report in reports:
            progress(f"{report.plan.site.name}: figures and scene")
            report.draw()  # while the errors are predicted
        hilly = any(report.plan.site.terrain is not None for report in reports)
        names = [name for name in CSV_TABLES if hilly or name not in OF_TERRAIN]
        texts = {f"{name}.csv": _csv(reports, name) for name in names}
        texts = {PAGE: _page(reports, progress), **texts}
        for name, text in texts.items():
            (staging / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


@contextmanager
def _asking_for_opengl() -> Iterator[None]:
    """Ask a child process whether this machine can draw while this one computes: it takes a second."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(max_workers=1) as pool:
        pool.submit(opengl.off_screen_window)
        yield


Curves = Callable[[], Sequence[ErrorCurve]]


@contextmanager
def _predicting(plans: Sequence[Plan], *, aside: bool) -> Iterator[list[Curves | None]]:
    """Predict the sectors' errors of plans in a child process, if asked to; leaving early ends the child."""
    if not aside:
        yield [None] * len(plans)
        return
    from multiprocessing import get_context

    with get_context("spawn").Pool(1, _leave_interrupts_to_the_parent) as pool:
        yield [pool.apply_async(_errors_of, (plan.site,)).get for plan in plans]


def _leave_interrupts_to_the_parent() -> None:
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _errors_of(site: Site) -> Sequence[ErrorCurve]:
    return Plan(site).predicted.sector_errors()


def report_html(plans: Sequence[Plan], *, progress: Progress = lambda _: None) -> str:
    """The page alone, as text."""
    return _page([SiteReport(plan, number) for number, plan in enumerate(plans, start=1)], progress)


def _csv(reports: Sequence[SiteReport], name: str) -> str:
    """One table of all sites, the site's name in the first column."""
    tables = [(report.plan.site.name, report.tables[name]) for report in reports]
    rows = [(site, *row) for site, table in tables for row in table.file_rows]
    return csv_text((SITE_COLUMN, *tables[0][1].file_columns), rows)


def _page(reports: Sequence[SiteReport], progress: Progress) -> str:
    from importlib.resources import files

    from jinja2 import Environment, StrictUndefined

    sites = [_site(report, progress) for report in reports]
    scripts = [
        script
        for site in sites
        for script in findall(r"<script[^>]*>(.*?)</script>", str(site["scene_div"]), DOTALL)
    ]
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["picture"] = _attributes
    template = environment.from_string(
        files("planner.templates").joinpath("report.html.j2").read_text(encoding="utf-8")
    )
    return template.render(
        sites=[{**site, "scene_div": Markup(site["scene_div"])} for site in sites],
        rows=list(zip(*(report.numbers for report in reports), strict=True)),
        made=made_line(),
        policy=_policy(scripts),
        sheet_style=Markup(sheet_style()),
        palette=palette,
        quantity=quantity,
    )


def _policy(scripts: Sequence[str]) -> str:
    """Nothing may be loaded; of scripts only these run (plotly's 3-D needs eval)."""
    digests = " ".join(
        f"'sha256-{b64encode(sha256(script.encode('utf-8')).digest()).decode()}'" for script in scripts
    )
    return (
        f"default-src 'none'; script-src {digests} 'unsafe-eval'; style-src 'unsafe-inline'; "
        "img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'"
    )


def _site(report: SiteReport, progress: Progress) -> dict[str, object]:
    """Everything that the template needs of one site."""
    plan = report.plan
    progress(f"{plan.site.name}: errors and tables")
    numbers = {
        "number": report.number,
        "site": plan.site,
        "crs": plan.site.crs,
        "summary": _summary(report),
        "numbers": report.numbers,
        "tables": report.tables,
        "free": [_free_sentence(item) for item in most_lost(plan)],
        "errors": _error_parts(report.errors),
        "budgets": [budget_table(item) for item in plan.budgets],
        "tradeoff": tradeoff_figure(report.trades) if report.trades else None,
        "assumptions": assumptions(plan.site),
        "findings": report.findings,
        "convergence_deg": plan.convergence_deg,
        "sheets": Markup(sheet_html(plan, heading="h4")) if plan.site.lidars else "",
    }
    return {**numbers, **report.pictures}


def _summary(report: SiteReport) -> str:
    """One line: counts of findings and the main numbers."""
    main = {number.label: number.text for number in report.numbers}
    parts = [f"{finding_counts(report.findings).capitalize()}", main["on the site"]]
    for label, words in (
        ("opening angle of pairs [°]", "opening angle {}°"),
        (MISSES, "beams that miss their target: {}"),
        ("of that wind lost to wakes, worst scan", "{} of the wanted wind lost to wakes"),
        ("recommended sector", "recommended sector {}"),
    ):
        if not main[label].startswith((DASH, "none")):
            parts.append(words.format(main[label]))
    return "; ".join(parts) + "."


def _free_sentence(item: Exclusion) -> dict[str, str]:
    """What the site file declares beside what is found, for a target's scan that wakes take most from."""
    return {
        "scan": item.scan,
        "target": item.target,
        "declared": directions(item.wanted),
        "found": directions(item.free),
        "lost": directions(item.wanted.intersection(item.excluded)),
        "share": percent(item.lost_share),
        "unused": directions(item.free.difference(item.wanted)),
    }


def _error_parts(entries: Sequence[Entry]) -> list[dict[str, object]]:
    """Tables, figures and words: one part for each sector scan, then one for all pairs."""
    pairs = [entry for entry in entries if "pair" in entry]
    parts = [_sector_part(entry) for entry in entries if "pair" not in entry]
    if pairs:
        parts.append(
            {
                "title": "Pairs",
                "entry": pairs[0],
                "blocked": [
                    f"{entry['scan']}: {entry['blocked_remark']}"
                    for entry in pairs
                    if entry["blocked_remark"]
                ],
                "best": None,
                "table": pair_table(pairs),
                "figure": None,
                "unknown": unknown_numbers(pairs),
            }
        )
    return parts


def _sector_part(entry: Entry) -> dict[str, object]:
    best, sizes = entry["recommended_sector_deg"], [size["sector_deg"] for size in entry["sizes"]]
    title = f"{entry['scan']} → {entry['target']}"
    figure = (
        sector_error([tier_curve(entry)], title=f"{title}, tier {entry['tier']}", recommended_deg=best)
        if len(sizes) > 1
        else None
    )
    return {
        "title": title,
        "entry": entry,
        "blocked": [entry["blocked_remark"]] if entry["blocked_remark"] else [],
        "best": sizes.index(best) if best is not None and best in sizes else None,
        "table": size_table(entry),
        "figure": figure,
        "unknown": unknown_numbers([entry]),
    }


def _scene_part(report: SiteReport) -> dict[str, object]:
    """The interactive scene, and its picture or why there is none."""
    from planner.scene import plotly_adapter

    first = report.number == 1
    name = f"scene-{report.number}"
    try:
        picture, reason = _picture(report.scene), ""
    except UnavailableError as error:
        picture, reason = None, str(error)
    return {
        "scene_div": plotly_adapter.div(report.scene, with_library=first, name=name),
        "picture": picture,
        "no_picture": reason,
    }


def _picture(scene: Scene) -> bytes:
    from planner.scene.pyvista_adapter import render_image

    pixels = render_image(scene, width_px=PICTURE_PX[0], height_px=PICTURE_PX[1])
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG")
    return buffer.getvalue()


def _attributes(picture: bytes, dpi: int = DPI) -> Markup:
    """Source, width and height of an image tag; a PNG says its size in bytes 16 to 24."""
    width, height = (round(int.from_bytes(picture[i : i + 4]) * SCREEN_DPI / dpi) for i in (16, 20))
    data = b64encode(picture).decode()
    return Markup(f'src="data:image/png;base64,{data}" width="{width}" height="{height}"')
