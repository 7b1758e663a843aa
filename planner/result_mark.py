"""What the results in a folder were retrieved from: those of another campaign are not taken for one's own."""

import hashlib
import json
from pathlib import Path

from geometry.errors import InputError
from planner.files.yaml_campaign import Loaded

MARK = "retrieved.json"

# Keys of a campaign file that its winds depend on; selection, mast and title are for the comparison alone.
KEYS = ("inputs", "pairs", "sizes_deg", "columns", "weights", "filters", "time_lag", "sonics")
AVERAGING = ("periods_s", "time_shift_s")
SITE_KEYS = {
    *("crs", "height_datum", "geoid_undulation_m", "ground_height_m"),
    *("lidars", "masts", "targets", "scans", "pairs"),
}


def write_mark(folder: Path, loaded: Loaded) -> None:
    """Keep beside results which campaign file they come from, and a hash of each of its settings."""
    told = {"campaign": loaded.path.name, "settings": settings_of(loaded)}
    (folder / MARK).write_text(json.dumps(told, ensure_ascii=False, indent=1), encoding="utf-8")


def require_own_results(loaded: Loaded) -> None:
    """Refuse results that were retrieved from other settings than the campaign's.

    Raises
    ------
    InputError
        If the folder of the results says so, or says nothing.
    """
    folder, again = loaded.campaign.output, f"run `lidarplan retrieve {loaded.path}` first"
    try:
        told = json.loads((folder / MARK).read_text(encoding="utf-8"))
        before, source = dict(told["settings"]), str(told["campaign"])
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{folder} does not say what its winds were retrieved from: {again}") from None
    now = settings_of(loaded)
    if other := [name for name in {**now, **before} if now.get(name) != before.get(name)]:
        raise InputError(
            f"{folder} holds winds that were retrieved from {source} with other settings than {loaded.path} has "
            f"({', '.join(other)}): {again}, and give campaigns that differ an `output` each"
        )


def settings_of(loaded: Loaded) -> dict[str, str]:
    """A short hash of every setting that the winds depend on, by its key; paths as the file writes them."""
    written = loaded.as_written
    values: dict[str, object] = written.model_dump(mode="json", include=set(KEYS))
    values["averaging"] = written.averaging.model_dump(mode="json", include=set(AVERAGING))
    if written.time_lag.against == "mast":
        values["mast"] = None if written.mast is None else written.mast.model_dump(mode="json")
    site = loaded.site.model_dump(mode="json", include=SITE_KEYS)
    for lidar in site["lidars"]:
        del lidar["uncertainty"]  # of the prediction alone
    values["site"] = site
    return {
        name: hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:12]
        for name, value in values.items()
    }
