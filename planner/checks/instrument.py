"""What is not known of the instruments in use, so that nothing is checked against it."""

from collections.abc import Iterator

from planner.finding import Finding
from planner.instruments import Instrument
from planner.plan import Plan


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about missing numbers, once for each instrument that scans."""
    devices = {layout.lidar.device.name: layout.lidar.device for layout in plan.layouts}
    for device in devices.values():
        yield from _head(device)
        yield from _limits(device)


def _head(device: Instrument) -> Iterator[Finding]:
    """A head of which nothing is known."""
    if device.head is None:
        text = (
            f"nothing is known of the head of {device.name}: turning is counted as taking no time; give the "
            "instrument's head in the site file"
        )
        yield Finding("info", "head-unknown", device.name, None, "deg/s", None, text)


def _limits(device: Instrument) -> Iterator[Finding]:
    """Limits that no source gives."""
    head = device.head
    limits = {
        "shortest range": device.min_range_m,
        "longest range": device.max_range_m,
        "number of gates": device.max_gates,
        "shortest accumulation": device.min_accumulation_s,
        "radial-speed limit": device.radial_speed_limit_mps,
        "lowest elevation": None if head is None else head.elevation_min_deg,
        "highest elevation": None if head is None else head.elevation_max_deg,
    }
    unknown = [name for name, limit in limits.items() if limit is None]
    if unknown:
        text = (
            f"not known of {device.name}, and so not checked: {', '.join(unknown)}; give them with the "
            "instrument in the site file"
        )
        yield Finding("info", "limits-unknown", device.name, len(unknown), "numbers", 0, text)
