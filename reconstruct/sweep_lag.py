"""How far the recorded azimuth leads the middle of the ray, from up- against down-sweeps of the radial
speeds.

A stamp that leads by δ in the direction of the sweep shifts the profile v_r(azimuth) of an up-sweep by +δ and
that of a down-sweep by -δ. The δ that brings the mean profiles of both on top of each other is the lead;
nothing is assumed of the wind but that it is the same on average in up- and in down-sweeps.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.records import Records

#: Leads that are looked for go to this many steps of the scan either way.
LARGEST_LEAD_STEPS = 3.0

#: Sweeps with fewer rays than this share of the longest take no part.
LEAST_SHARE = 0.8

#: Gates whose ray-to-ray noise is larger than this hold noise and no wind [m/s].
LARGEST_NOISE_MPS = 1.0

#: Fewest sweeps: one between two of the other direction.
LEAST_SWEEPS = 3

#: Sweeps that are looked at: with 12 s a sweep the first forty minutes. The lead is the instrument's, it stays.
MOST_SWEEPS = 201

#: Parts that the jackknife leaves out, one at a time.
MOST_BLOCKS = 20

#: The slope of a profile is taken over this many rays to each side.
SLOPE_RAYS = 3

#: Gauss-Newton steps: each leaves a small part of the error of the one before.
MOST_STEPS = 20


class SweepLead(NamedTuple):
    """How far the stamps lead the rays."""

    lead_deg: float  # positive where the stamp is ahead in the direction of the sweep
    std_deg: float  # from leaving blocks of sweeps out (jackknife); NaN with fewer than five sweeps
    sweeps: int  # that took part


class _Sweep(NamedTuple):
    """One sweep in the order of its angles."""

    way: float  # 1 clockwise, -1 anticlockwise
    azimuth_deg: FloatArray  # (ray,) rising, without jumps at 360
    speed_mps: FloatArray  # (ray, gate)


def sweeps_of(records: Records) -> list[IntArray]:
    """Indices of the rays of each sweep, in the order of time."""
    order = np.argsort(records.sweep_id, kind="stable")
    edges = np.flatnonzero(np.diff(records.sweep_id[order])) + 1
    return list(np.split(order, edges)) if len(order) else []


def sweep_rate(records: Records) -> FloatArray:
    """(ray,) turn of the head from ray to ray within its sweep [deg], signed, clockwise positive."""
    turn = np.zeros(records.rays)
    for rays in sweeps_of(records):
        if len(rays) > 1:
            turn[rays] = np.gradient(np.unwrap(records.azimuth_deg[rays], period=360.0))
    return turn


def without_lead(records: Records, lead_deg: float) -> Records:
    """The same records with every azimuth turned back by a lead in the direction of its sweep [deg]."""
    turned = records.azimuth_deg - lead_deg * np.sign(sweep_rate(records))
    return replace(records, azimuth_deg=np.asarray(wrap_360_deg(turned)))


def evened(records: Records) -> tuple[Records, int]:
    """The same records with azimuths that run evenly in time within each sweep.

    A head that sweeps turns at a constant speed, yet a unit's stamps may lead in one part of a sweep and not
    in the other (one step is skipped on the way). Each sweep gets the line in time, at the usual speed, that
    most of its stamps lie on. One that is shorter than half begins where its neighbour's line turns.

    Parameters
    ----------
    records : Records
        A sector that is swept to and fro.

    Returns
    -------
    records : Records
        As they came where stamps do not lie on lines.
    moved : int
        Rays whose azimuth changes by more than a quarter of a step.
    """
    seconds = (records.time_utc - records.time_utc[:1]) / np.timedelta64(1, "s")
    sweeps = [rays for rays in sweeps_of(records) if len(rays) > 1]
    unwrapped = [np.unwrap(records.azimuth_deg[rays], period=360.0) for rays in sweeps]
    if not sweeps:
        return records, 0
    steps = np.abs(np.concatenate([np.diff(angle) for angle in unwrapped]))
    spans = np.concatenate([np.diff(seconds[rays]) for rays in sweeps])
    step, rate = float(np.median(steps)), float(np.median(steps / np.maximum(spans, 1e-9)))
    ways = [float(np.sign(angle[-1] - angle[0])) for angle in unwrapped]
    starts = [
        float(np.median(angle - way * rate * seconds[rays]))
        for rays, angle, way in zip(sweeps, unwrapped, ways, strict=True)
    ]
    starts = _starts_of_short(starts, ways, [len(rays) for rays in sweeps])
    even = records.azimuth_deg.copy()
    for rays, way, start in zip(sweeps, ways, starts, strict=True):
        even[rays] = start + way * rate * seconds[rays]
    change = np.abs((even - records.azimuth_deg + 180.0) % 360.0 - 180.0)
    if np.median(change) > step / 4:
        return records, 0
    return replace(records, azimuth_deg=np.asarray(wrap_360_deg(even))), int(np.sum(change > step / 4))


def _starts_of_short(starts: Sequence[float], ways: Sequence[float], counts: Sequence[int]) -> list[float]:
    """Intercepts of the sweeps' lines, those of short sweeps set so that they turn where whole ones do."""
    whole = [count >= max(counts) / 2 for count in counts]
    turns: dict[float, list[float]] = {1.0: [], -1.0: []}  # angle at which a sweep of that direction ends
    for i in range(len(starts) - 1):
        if whole[i] and whole[i + 1] and ways[i] == -ways[i + 1] != 0:
            turns[ways[i]].append((starts[i] + starts[i + 1]) / 2)  # two lines of opposite slope cross there
    out = list(starts)
    for i, neighbour in ((0, 1), (len(starts) - 1, len(starts) - 2)):
        if len(starts) < 3 or whole[i] or not whole[neighbour] or ways[i] != -ways[neighbour]:
            continue
        ends = turns[ways[min(i, neighbour)]]
        if ends:
            out[i] = 2 * float(np.median(ends)) - starts[neighbour]
    return out


def estimate_lead(records: Records) -> SweepLead:
    """Find by how much the recorded azimuths lead the middles of their rays.

    Gates weigh by the inverse of their ray-to-ray variance, so that gates without signal take no part. The
    number of sweeps is made odd: up- and down-sweeps then have the same mean time and a steady change of the
    wind cancels.

    Parameters
    ----------
    records : Records
        A sector that is swept to and fro, three sweeps or more; of more than 201 the first.

    Returns
    -------
    SweepLead
        Its spread is that of the turbulence, which is not the same in up- and down-sweeps.

    Raises
    ------
    InputError
        If there are not enough sweeps to and fro, or no gate has a signal.
    """
    sweeps, step = _usable_sweeps(records)
    weight = _gate_weights(sweeps)
    gates = weight > 0
    if not np.any(gates):
        raise InputError(
            f"no gate has radial speeds with less than {LARGEST_NOISE_MPS:g} m/s of noise from ray to ray: "
            "up- and "
            "down-sweeps cannot be compared"
        )
    sweeps = [sweep._replace(speed_mps=sweep.speed_mps[:, gates]) for sweep in sweeps]
    lead = _best(sweeps, weight[gates], step)
    # whole pairs are left out, so that what stays has as many sweeps of either direction
    block = 2 * int(np.ceil((len(sweeps) // 2) / MOST_BLOCKS))
    left_out = [sweeps[:i] + sweeps[i + block :] for i in range(0, len(sweeps) - 1, block)]
    spread = float("nan")
    if len(sweeps) >= LEAST_SWEEPS + 2:
        values = np.array([_best(some, weight[gates], step, near=lead) for some in left_out])
        spread = float(np.sqrt((len(values) - 1) * np.mean(np.square(values - values.mean()))))
    return SweepLead(lead, spread, len(sweeps))


def _usable_sweeps(records: Records) -> tuple[list[_Sweep], float]:
    """An odd number of sweeps to and fro, and the usual step between rays [deg]."""
    every = sweeps_of(records)
    whole = max((len(rays) for rays in every), default=0)
    sweeps: list[_Sweep] = []
    for rays in every:
        if len(rays) < max(5, LEAST_SHARE * whole) or len(sweeps) == MOST_SWEEPS:
            continue
        azimuth = np.unwrap(records.azimuth_deg[rays], period=360.0)
        azimuth = azimuth - 360.0 * np.round((np.median(azimuth) - _middle(sweeps, azimuth)) / 360.0)
        order = np.argsort(azimuth, kind="stable")
        way = float(np.sign(azimuth[-1] - azimuth[0]))
        if not sweeps or way == -sweeps[-1].way:
            sweeps.append(_Sweep(way, azimuth[order], records.radial_speed_mps[rays][order]))
    if len(sweeps) < LEAST_SWEEPS:
        raise InputError(
            f"{len(sweeps)} whole sweeps run to and fro: {LEAST_SWEEPS} or more are needed to find how far "
            "the azimuth stamps lead"
        )
    sweeps = sweeps[: len(sweeps) - 1 + len(sweeps) % 2]
    return sweeps, float(np.median(np.abs(np.concatenate([np.diff(sweep.azimuth_deg) for sweep in sweeps]))))


def _middle(sweeps: Sequence[_Sweep], azimuth: FloatArray) -> float:
    """Middle of the first sweep, to which the others are brought by whole turns."""
    return float(np.median(sweeps[0].azimuth_deg if sweeps else azimuth))


def _gate_weights(sweeps: Sequence[_Sweep]) -> FloatArray:
    """(gate,) one over the noise variance from second differences along the sweep; 0 where there is no
    signal.
    """
    total = np.zeros(sweeps[0].speed_mps.shape[1])
    count = np.zeros(len(total))
    for sweep in sweeps:
        bends = np.diff(sweep.speed_mps, n=2, axis=0)
        total += np.nansum(np.square(bends), axis=0)
        count += np.sum(np.isfinite(bends), axis=0)
    rays = sum(len(sweep.azimuth_deg) for sweep in sweeps)
    variance = (
        total / np.maximum(count, 1) / 6.0
    )  # a second difference of white noise has six times its variance
    signal = (count > rays / 2) & (variance < LARGEST_NOISE_MPS**2)
    return np.where(signal, 1.0 / np.maximum(variance, 1e-6), 0.0)


def _best(
    sweeps: Sequence[_Sweep], weight: FloatArray, step_deg: float, *, near: float | None = None
) -> float:
    """Lead [deg] that brings the mean profiles of the two directions on top of each other.

    First the smallest misfit of a coarse search, or one that is given; then Gauss-Newton steps to where the
    difference of the profiles is orthogonal to their slope. The smallest misfit itself would favour leads of
    half a step, where interpolation averages the noise of two rays.
    """
    reach = LARGEST_LEAD_STEPS * step_deg
    low = max(sweep.azimuth_deg[0] for sweep in sweeps) + reach
    high = min(sweep.azimuth_deg[-1] for sweep in sweeps) - reach
    if high - low < 2 * step_deg:  # a short sector: smaller leads only
        reach = (high - low + 2 * reach) / 4
        low, high = low - reach, high + reach
    grid = np.arange(low, high, step_deg)
    if near is None:
        coarse = np.linspace(-reach, reach, 13)
        near = float(coarse[np.argmin([_misfit(sweeps, weight, grid, float(lead)) for lead in coarse])])
    lead = near
    for _ in range(MOST_STEPS):
        change = _newton_step(sweeps, weight, grid, lead)
        lead = float(np.clip(lead + change, -reach, reach))
        if abs(change) < 1e-4 * step_deg:
            break
    return lead


def _differences(
    sweeps: Sequence[_Sweep], azimuth_deg: FloatArray, lead_deg: float
) -> tuple[FloatArray, FloatArray]:
    """(angle, gate) difference and mean of the profiles of the two directions, turned back by a lead."""
    up, down = (_mean_profile(sweeps, way, azimuth_deg + way * lead_deg) for way in (1.0, -1.0))
    return up - down, (up + down) / 2


def _misfit(sweeps: Sequence[_Sweep], weight: FloatArray, azimuth_deg: FloatArray, lead_deg: float) -> float:
    """Weighted mean square difference of the two profiles."""
    square = np.square(_differences(sweeps, azimuth_deg, lead_deg)[0])
    known = np.isfinite(square)
    return float(np.sum(np.where(known, square, 0.0) * weight) / max(np.sum(known * weight), 1e-12))


def _newton_step(
    sweeps: Sequence[_Sweep], weight: FloatArray, azimuth_deg: FloatArray, lead_deg: float
) -> float:
    """Change of the lead [deg]: the difference is twice what is left of the lead times the slope."""
    difference, mean = _differences(sweeps, azimuth_deg, lead_deg)
    reach = min(SLOPE_RAYS, (len(azimuth_deg) - 1) // 2)
    if reach < 1:
        return 0.0
    slope = (mean[2 * reach :] - mean[: -2 * reach]) / (azimuth_deg[2 * reach :] - azimuth_deg[: -2 * reach])[
        :, None
    ]
    inner = difference[reach:-reach]
    known = np.isfinite(slope) & np.isfinite(inner)
    slope, inner = np.where(known, slope, 0.0), np.where(known, inner, 0.0)
    square = float(np.sum(weight * np.square(slope)))
    return 0.0 if square == 0 else -float(np.sum(weight * inner * slope)) / (2 * square)


def _mean_profile(sweeps: Sequence[_Sweep], way: float, azimuth_deg: FloatArray) -> FloatArray:
    """(angle, gate) mean radial speed of the sweeps of one direction, NaN values left out."""
    values = np.stack([_between(sweep, azimuth_deg) for sweep in sweeps if sweep.way == way])
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.asarray(np.where(known, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan))


def _between(sweep: _Sweep, azimuth_deg: FloatArray) -> FloatArray:
    """(angle, gate) radial speeds at some angles, straight between rays."""
    at = sweep.azimuth_deg
    left = np.clip(np.searchsorted(at, azimuth_deg, "right") - 1, 0, len(at) - 2)
    share = ((azimuth_deg - at[left]) / np.maximum(at[left + 1] - at[left], 1e-9))[:, None]
    return np.asarray(sweep.speed_mps[left] * (1 - share) + sweep.speed_mps[left + 1] * share)
