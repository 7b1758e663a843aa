"""What a Monte Carlo run says: every number with its standard error.

The standard errors come from a jackknife over blocks that share nothing: each block is one random field,
however many flights went through it.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from reconstruct.wind import WindState, from_deg, scalar_mean, speed_mps, vector_mean

ComplexArray = NDArray[np.complex128]
Reference = Literal["scalar", "vector"]


class Estimate(NamedTuple):
    """A number and how far chance may have moved it (k = 1)."""

    value: float
    standard_error: float


@dataclass(frozen=True)
class Simulation:
    """Retrieved wind of many realisations of the same scans, and what an instrument at the target saw."""

    wind: WindState
    scan_mps: FloatArray  # (realisation, scan, 2) retrieved u, v; NaN where the fit has no answer
    reference_mps: FloatArray  # (realisation, sample, 2) u, v at the target
    block: IntArray  # (realisation,) realisations of one block share a field
    condition: float

    @property
    def lost_scans(self) -> int:
        """Number of scans without an answer."""
        return int(np.count_nonzero(np.isnan(self.scan_mps[..., 0])))


@dataclass(frozen=True)
class Verdict:
    """Errors of one scan and of one averaging period: bias is retrieved - true.

    Of a scan the truth is the mean wind; of a period it is the period's own reference, and `slope` is the `a`
    that minimises the sum of (reference - a lidar)².
    """

    scan_speed_mps: Estimate
    reference_speed_mps: Estimate  # mean over the periods, scalar or vector as asked
    speed_bias_mps: Estimate  # of a scan against the mean wind, which is the vector reference
    speed_std_mps: Estimate
    direction_bias_deg: Estimate
    direction_std_deg: Estimate
    mean10_speed_bias_mps: Estimate
    mean10_speed_std_mps: Estimate
    mean10_direction_bias_deg: Estimate
    mean10_direction_std_deg: Estimate
    slope: Estimate
    residual_std_mps: Estimate
    covariance_m2s2: tuple[Estimate, Estimate, Estimate]  # of one scan: uu, uv, vv


class _Periods(NamedTuple):
    """Values of every realisation, so that statistics are quick to repeat without one block."""

    scan_speed: FloatArray  # (realisation, scan)
    scan_turn: ComplexArray  # (realisation, scan) direction error, as a unit vector
    scan_uv: FloatArray  # (realisation, scan, 2)
    lidar: FloatArray  # (realisation,) mean speed
    reference: FloatArray  # (realisation,)
    turn: ComplexArray  # (realisation,) direction error of the period


def judge(simulation: Simulation, *, reference: Reference = "scalar") -> Verdict:
    """Reduce a simulation to errors with standard errors.

    Parameters
    ----------
    simulation : Simulation
        From `monte_carlo.simulate`.
    reference : {"scalar", "vector"}
        What the period's mean of the lidar's scan speeds is compared with: the mean speed of a cup or the
        speed of the mean vector of a sonic.

    Returns
    -------
    Verdict
        Standard errors are NaN if all realisations share one block.

    Examples
    --------
    >>> wind = WindState(speed_mps=10.0, from_deg=270.0)
    >>> scans = np.array([[[10.1, 0.0], [9.9, 0.0]], [[10.3, 0.0], [10.1, 0.0]]])
    >>> still = np.broadcast_to([10.0, 0.0], (2, 1, 2))
    >>> verdict = judge(Simulation(wind, scans, still, np.arange(2), condition=1.0))
    >>> round(verdict.speed_bias_mps.value, 3), round(verdict.speed_bias_mps.standard_error, 3)
    (0.1, 0.1)
    """
    periods, truth = _periods(simulation, reference), simulation.wind.speed_mps
    statistics: dict[str, Callable[[_Periods], float]] = {
        "scan_speed_mps": lambda p: _mean(p.scan_speed),
        "reference_speed_mps": lambda p: _mean(p.reference),
        "speed_bias_mps": lambda p: _mean(p.scan_speed) - truth,
        "speed_std_mps": lambda p: _std(p.scan_speed),
        "direction_bias_deg": lambda p: _mean_turn(p.scan_turn),
        "direction_std_deg": lambda p: _std_turn(p.scan_turn),
        "mean10_speed_bias_mps": lambda p: _mean(p.lidar - p.reference),
        "mean10_speed_std_mps": lambda p: _std(p.lidar - p.reference),
        "mean10_direction_bias_deg": lambda p: _mean_turn(p.turn),
        "mean10_direction_std_deg": lambda p: _std_turn(p.turn),
        "slope": lambda p: slope(p.lidar, p.reference),
        "residual_std_mps": lambda p: _std(p.reference - slope(p.lidar, p.reference) * p.lidar),
    }
    blocks = np.unique(simulation.block)
    without = [_Periods(*(part[simulation.block != block] for part in periods)) for block in blocks]
    found = {name: _jackknife(statistic, periods, without) for name, statistic in statistics.items()}
    uu, uv, vv = (_jackknife(_covariance_of(i, j), periods, without) for i, j in ((0, 0), (0, 1), (1, 1)))
    return Verdict(**found, covariance_m2s2=(uu, uv, vv))


class CampaignVerdict(NamedTuple):
    """Errors over the states of a climate: mean bias, root-mean-square scatter, regression of all periods."""

    speed_bias_mps: Estimate  # of a scan against the mean of the reference
    speed_std_mps: Estimate
    direction_bias_deg: Estimate
    direction_std_deg: Estimate
    mean10_speed_bias_mps: Estimate
    mean10_speed_std_mps: Estimate
    mean10_direction_std_deg: Estimate
    slope: Estimate
    residual_std_mps: Estimate
    direction_residual_std_deg: Estimate  # about the mean bias of all states


def judge_campaign(
    simulations: Sequence[Simulation], weight: FloatArray, *, reference: Reference = "scalar"
) -> CampaignVerdict:
    """Reduce simulations of every state of a climate to what a campaign would show, with standard errors.

    Parameters
    ----------
    simulations : sequence of Simulation
        One for each state, through the same fields.
    weight : numpy.ndarray
        (state,) how often each state comes.
    reference : {"scalar", "vector"}
        As in `judge`.

    Returns
    -------
    CampaignVerdict
        Standard errors by a jackknife that leaves one field out of all states at a time.

    Examples
    --------
    >>> wind = WindState(speed_mps=10.0, from_deg=270.0)
    >>> scans = np.array([[[10.1, 0.0], [9.9, 0.0]], [[10.3, 0.0], [10.1, 0.0]]])
    >>> still = np.broadcast_to([10.0, 0.0], (2, 1, 2))
    >>> one = Simulation(wind, scans, still, np.arange(2), condition=1.0)
    >>> round(judge_campaign([one, one], np.array([0.5, 0.5])).slope.value, 3)
    0.99
    """
    periods = [_periods(simulation, reference) for simulation in simulations]
    blocks = np.unique(simulations[0].block)
    names = CampaignVerdict._fields
    whole = _over_states(periods, weight)
    without = [
        _over_states(
            [
                _Periods(*(part[simulation.block != block] for part in each))
                for each, simulation in zip(periods, simulations, strict=True)
            ],
            weight,
        )
        for block in blocks
    ]
    spread = np.array([[parts[name] for name in names] for parts in without])
    error = np.sqrt((1 - 1 / len(blocks)) * np.sum(np.square(spread - spread.mean(axis=0)), axis=0))
    known = len(blocks) > 1
    return CampaignVerdict(
        *(Estimate(whole[name], float(error[i]) if known else float("nan")) for i, name in enumerate(names))
    )


def _over_states(states: Sequence[_Periods], weight: FloatArray) -> dict[str, float]:
    """Statistics of a campaign, by name."""

    def mean(values: Iterable[float]) -> float:
        return float(np.dot(weight, list(values)) / np.sum(weight))

    def scatter(values: Iterable[float]) -> float:
        return float(np.sqrt(mean(np.square(list(values)))))

    shares = [np.full(len(p.lidar), w / len(p.lidar)) for p, w in zip(states, weight, strict=True)]
    share = np.concatenate(shares)
    lidar, mast = (np.concatenate([getattr(p, name) for p in states]) for name in ("lidar", "reference"))
    turn = np.concatenate([p.turn for p in states])
    share = np.where(np.isfinite(lidar) & np.isfinite(mast), share, 0.0)
    lidar, mast = np.nan_to_num(lidar), np.nan_to_num(mast)
    fitted = float(np.sum(share * mast * lidar) / np.sum(share * lidar**2))
    residual = mast - fitted * lidar
    centre = np.sum(share * np.nan_to_num(turn))
    off = np.degrees(np.angle(np.nan_to_num(turn) * np.conj(centre)))
    total = float(np.sum(share))
    return {
        "speed_bias_mps": mean(_mean(p.scan_speed) - _mean(p.reference) for p in states),
        "speed_std_mps": scatter(_std(p.scan_speed) for p in states),
        "direction_bias_deg": mean(_mean_turn(p.scan_turn.ravel()) for p in states),
        "direction_std_deg": scatter(_std_turn(p.scan_turn.ravel()) for p in states),
        "mean10_speed_bias_mps": mean(_mean(p.lidar - p.reference) for p in states),
        "mean10_speed_std_mps": scatter(_std(p.lidar - p.reference) for p in states),
        "mean10_direction_std_deg": scatter(_std_turn(p.turn) for p in states),
        "slope": fitted,
        "residual_std_mps": float(
            np.sqrt(np.sum(share * residual**2) / total - (np.sum(share * residual) / total) ** 2)
        ),
        "direction_residual_std_deg": float(np.sqrt(np.sum(share * off**2) / total)),
    }


def slope(lidar_mps: FloatArray, reference_mps: FloatArray) -> float:
    """Slope a through the origin that minimises the sum of (reference - a lidar)².

    Examples
    --------
    >>> slope(np.array([1.0, 2.0]), np.array([2.0, 4.0]))
    2.0
    """
    known = np.isfinite(lidar_mps) & np.isfinite(reference_mps)
    squares = float(np.sum(np.square(lidar_mps[known])))
    return float(np.sum(lidar_mps[known] * reference_mps[known])) / squares if squares > 0 else float("nan")


def _periods(simulation: Simulation, reference: Reference) -> _Periods:
    u, v = simulation.scan_mps[..., 0], simulation.scan_mps[..., 1]
    at_u, at_v = simulation.reference_mps[..., 0], simulation.reference_mps[..., 1]
    mean_u, mean_v = vector_mean(at_u, at_v)
    scalar = scalar_mean(at_u, at_v) if reference == "scalar" else speed_mps(mean_u, mean_v)
    return _Periods(
        scan_speed=speed_mps(u, v),
        scan_turn=_turn(from_deg(u, v) - simulation.wind.from_deg),
        scan_uv=simulation.scan_mps,
        lidar=scalar_mean(u, v),
        reference=scalar,
        turn=_turn(from_deg(*vector_mean(u, v)) - from_deg(mean_u, mean_v)),
    )


def _jackknife(statistic: Callable[[_Periods], float], whole: _Periods, without: list[_Periods]) -> Estimate:
    """Value of a statistic, and its standard error from leaving out one block at a time.

    SE² = (B - 1)/B sum (T_b - mean T)² over B blocks (Efron and Stein 1981, Ann. Statist. 9, 586-596,
    doi:10.1214/aos/1176345462, eq. 1.4 and 1.5).
    """
    if len(without) < 2:
        return Estimate(statistic(whole), float("nan"))
    parts = np.array([statistic(part) for part in without])
    spread = float(np.sum(np.square(parts - np.mean(parts))))
    return Estimate(statistic(whole), float(np.sqrt((1 - 1 / len(parts)) * spread)))


def _turn(angle_deg: FloatArray) -> ComplexArray:
    return np.asarray(np.exp(1j * np.radians(angle_deg)))


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else float("nan")


def _std(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.std(known, ddof=1)) if known.size > 1 else float("nan")


def _mean_turn(turn: ComplexArray) -> float:
    """Circular mean of direction errors [degrees], given as unit vectors."""
    known = turn[np.isfinite(turn)]
    return float(np.degrees(np.angle(np.sum(known)))) if known.size else float("nan")


def _std_turn(turn: ComplexArray) -> float:
    """Standard deviation of the wrapped errors from their circular mean [degrees]."""
    known = turn[np.isfinite(turn)]
    if known.size < 2:
        return float("nan")
    square = np.sum(np.square(np.angle(known * np.conj(np.sum(known)))))
    return float(np.degrees(np.sqrt(square / (known.size - 1))))


def _covariance_of(i: int, j: int) -> Callable[[_Periods], float]:
    def covariance(periods: _Periods) -> float:
        first, second = periods.scan_uv[..., i].ravel(), periods.scan_uv[..., j].ravel()
        known = np.isfinite(first) & np.isfinite(second)
        count = int(np.count_nonzero(known))
        if count < 2:
            return float("nan")
        first, second = first[known], second[known]
        return float(np.dot(first - np.mean(first), second - np.mean(second)) / (count - 1))

    return covariance
