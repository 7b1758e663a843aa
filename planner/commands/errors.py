"""`lidarplan errors SITE`: the predicted error per sector size."""

from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from planner.budget import Budget
    from planner.error_curve import SizesFrom
    from planner.error_nouns import ErrorCurve, SizeError
    from planner.plan import Plan
    from planner.scan_layout import ScanLayout
    from reconstruct.prediction import Tier

SizesOption = Annotated[
    str | None,
    typer.Option(
        "--sizes",
        metavar="DEG,DEG,...",
        help="Sector sizes, such as 60,30,8. [default: the declared one and smaller]",
    ),
]
SizesFromOption = Annotated[
    str,
    typer.Option(
        "--sizes-from",
        metavar="own|subset",
        help="own: each size a scan of its own; subset: the declared scan's middle rays.",
    ),
]
TierOption = Annotated[
    str | None,
    typer.Option(
        "--tier",
        metavar="noise|linear|turbulent|monte-carlo",
        help="How to predict. [default: turbulent, or linear without turbulence]",
    ),
]

BudgetOption = Annotated[
    bool, typer.Option("--budget", help="Add the uncertainty budget of the ten-minute means.")
]

TIERS: tuple["Tier", ...] = ("noise", "linear", "turbulent", "monte-carlo")


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("errors", short_help="Predicted error per sector size, and the size to take.")(errors)


def errors(
    site: SiteArgument,
    sizes: SizesOption = None,
    sizes_from: SizesFromOption = "own",
    tier: TierOption = None,
    fidelity: FidelityOption = None,
    budget: BudgetOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Predicted error of speed and direction per sector size, and the recommended size."""
    from planner.commands.choices import chosen, numbers
    from planner.commands.load import load_plan
    from planner.commands.progress import shown

    kind: SizesFrom = chosen("--sizes-from", sizes_from, ("own", "subset"))
    by: Tier | None = None if tier is None else chosen("--tier", tier, TIERS)
    sizes_deg = None if sizes is None else numbers("--sizes", sizes)
    plan = load_plan(site, fidelity)
    _require_sizes(plan, sizes_deg or (), kind)
    with shown("simulating", quiet=quiet or by != "monte-carlo") as progress:
        curves = plan.errors(tier=by, sizes_deg=sizes_deg, sizes_from=kind, progress=progress)
    for text in _remarks(plan, curves, tier_given=by is not None):
        remark(text, quiet=quiet)
    if json:
        say_json([_document(plan, curve, budget=budget) for curve in curves])
        return
    if not curves:
        say("No sector scan and no pair has a target: there is no error to predict.")
    for curve in curves:
        _print(plan, curve)
    for item in plan.budgets if budget else ():
        _print_budget(item)
    remark(
        "Errors are retrieved less true, over the site's wind; scan: one scan; 10 min: its ten-minute mean against a cup "
        "at the target; "
        "slope: mast = slope · lidar; – : the tier cannot know it.",
        quiet=quiet,
    )


def _require_sizes(plan: "Plan", sizes_deg: "Sequence[float]", kind: "SizesFrom") -> None:
    """Refuse sizes that a sector scan cannot have, in words of the option they came by."""
    from geometry.errors import InputError
    from planner.ray_sets import own_scan, subset_of

    fits: Callable[[ScanLayout, float], object] = own_scan if kind == "own" else subset_of
    for layout in plan.layouts:
        for size_deg in sizes_deg if layout.spec.type == "sector" and layout.targets else ():
            try:
                fits(layout, size_deg)
            except InputError as error:
                raise InputError(
                    f"--sizes {size_deg:g} does not fit scan '{layout.name}': {error}"
                ) from error


def _remarks(plan: "Plan", curves: "Sequence[ErrorCurve]", *, tier_given: bool) -> "Iterator[str]":
    """What was passed over, and why the tier is no better."""
    from planner.wind_climate import turbulence

    told = {curve.scan for curve in curves}
    told.update(name for pair in plan.site.pairs if pair.name in told for name in pair.scans)
    over = [f"{layout.name} ({layout.spec.type})" for layout in plan.layouts if layout.name not in told]
    if over:
        yield f"Passed over: {', '.join(over)}; errors are of sector scans at a target and of pairs."
    if curves and not tier_given and turbulence(plan.site) is None:
        yield (
            "Linear tier, because the site file has no wind.turbulence: give it {intensity, length_m} there for the "
            "turbulent tier and a recommended size."
        )


def shown_value(size: "SizeError", name: str, how: str) -> str:
    """A value with its standard error, where it has one."""
    value, error = size.values[name], size.standard_errors.get(name)
    if value is None:
        return "–"
    spread = "" if error is None or error != error else f"±{format(error, how.removeprefix('+'))}"
    return format(value, how) + spread


def _document(plan: "Plan", curve: "ErrorCurve", *, budget: bool) -> dict[str, object]:
    from planner.error_entry import error_entry

    entry = dict(error_entry(plan, curve))
    for item in plan.budgets if budget else ():
        if (item.scan, item.target) == (curve.scan, curve.target):
            entry["budget"] = [part._asdict() for part in item.entries]
    return entry


def _print(plan: "Plan", curve: "ErrorCurve") -> None:
    from planner.commands.table import print_table
    from planner.error_entry import blocked_remark, scans_of

    columns = {
        "scan bias m/s": ("speed_bias_mps", "+.3f"),
        "scan ± m/s": ("speed_std_mps", ".3f"),
        "scan ± °": ("direction_std_deg", ".2f"),
        "10 min bias m/s": ("mean10_speed_bias_mps", "+.3f"),
        "10 min ± m/s": ("mean10_speed_std_mps", ".3f"),
        "10 min ± °": ("mean10_direction_std_deg", ".2f"),
        "slope": ("slope", ".4f"),
        "residual ± m/s": ("residual_std_mps", ".3f"),
    }
    rows = [
        (
            "–" if size.sector_deg is None else f"{size.sector_deg:g}",
            str(size.rays),
            str(size.scans_per_10min),
            "–" if size.condition is None else f"{size.condition:.1f}",
            *(shown_value(size, name, how) for name, how in columns.values()),
        )
        for size in curve.sizes
    ]
    title = f"{curve.scan} → {curve.target}, {curve.tier} tier, {curve.states} states of the wind"
    print_table(title, ("sector °", "rays", "scans/10 min", "condition", *columns), rows)
    advice = plan.recommendation(curve)
    if advice.sector_deg is not None:
        say(f"Recommended: {advice.reason}.")
        if advice.saving:
            say(f"Instead of more scans: {advice.saving}.")
    elif curve.lidar:
        say(f"No recommendation: {advice.reason}.")
    blocked = blocked_remark(plan, scans_of(plan, curve))
    say(f"Mind: {blocked}.\n" if blocked else "")


def _print_budget(budget: "Budget") -> None:
    from planner.commands.table import print_table

    def number(value: float | None, how: str) -> str:
        return "–" if value is None else format(value, how)

    rows = [
        (
            entry.source,
            number(entry.speed_std_mps, ".4f"),
            number(entry.expanded()[0], ".4f"),
            number(entry.speed_share, ".1%"),
            number(entry.direction_std_deg, ".3f"),
            number(entry.expanded()[1], ".3f"),
            number(entry.direction_share, ".1%"),
            entry.reason or "",
        )
        for entry in budget.entries
    ]
    wind = f"wind {budget.wind.speed_mps:.1f} m/s from {budget.wind.from_deg:.0f}°"
    title = f"Uncertainty of ten-minute means of {budget.scan} → {budget.target}, {wind}"
    columns = (
        "source",
        "speed m/s, k = 1",
        "k = 2",
        "share",
        "direction °, k = 1",
        "k = 2",
        "share",
        "why unknown",
    )
    print_table(title, columns, rows)
