"""Site -> Plan: everything that follows from the site file, each computed once, when first asked for.

What is below (checks, figures, scene, report, tables) reads the Plan and computes nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from geometry.angles import SectorSet, difference_deg, wrap_180_deg
from planner.crossings import JointFit, PairCrossing, crossings, joint_fits
from planner.exclusion import Exclusion, Near, exclusions, near_wakes, wanted_directions
from planner.fidelity import Effect, earth_model, geometric_effects
from planner.obstruction import Obstruction, obstructions
from planner.over_terrain import OverTerrain, over_terrain, terrain_obstructions
from planner.places import Places
from planner.pointing import Pointing, pointings
from planner.scan_layout import ScanLayout, lay_out
from planner.site import Site
from planner.wind_rose import prevailing_deg

if TYPE_CHECKING:  # what predicts errors is imported where it is used: pointing has no need to wait for it
    from numpy.random import Generator

    from planner.budget import Budget
    from planner.error_curve import SizesFrom
    from planner.error_nouns import ErrorCurve
    from planner.predicted import Predicted
    from planner.sector_size import Recommendation
    from planner.tradeoff import Progress, Trade
    from reconstruct.prediction import Tier


@dataclass(frozen=True)
class Plan:
    """A site and what follows from it."""

    site: Site

    @cached_property
    def exact_places(self) -> Places:
        """Frame and positions by the exact ellipsoid, which every effect is measured against."""
        return Places(self.site)

    @cached_property
    def geometric_effects(self) -> tuple[Effect, ...]:
        """Size of what a flat map leaves out, and what of it is modelled."""
        return geometric_effects(self.exact_places)

    @cached_property
    def places(self) -> Places:
        """Frame and positions by the cheapest model of the Earth that the site's tolerance allows."""
        return Places(self.site, earth_model(self.exact_places, self.geometric_effects))

    @cached_property
    def layouts(self) -> tuple[ScanLayout, ...]:
        """Every scan laid out in space, in the order of the site file."""
        return tuple(lay_out(self.exact_places, spec) for spec in self.site.scans)

    @cached_property
    def layout(self) -> Mapping[str, ScanLayout]:
        """The same by the scan's name."""
        return {layout.name: layout for layout in self.layouts}

    @cached_property
    def pointings(self) -> tuple[Pointing, ...]:
        """Every lidar at every target."""
        return pointings(self.exact_places, self.layouts)

    @cached_property
    def crossings(self) -> tuple[PairCrossing, ...]:
        """Every two beams of every pair, by the exact ellipsoid: a gap is not to be an artefact of a flat map."""
        return crossings(self.exact_places, self.layouts)

    @cached_property
    def joint_fits(self) -> tuple[JointFit, ...]:
        """How well the pairs that retrieve the vertical wind can tell it."""
        return joint_fits(self.exact_places, self.layouts)

    @cached_property
    def exclusions(self) -> tuple[Exclusion, ...]:
        """What wakes take from every scan at every target."""
        return exclusions(self.places, self.layouts)

    @cached_property
    def obstructions(self) -> tuple[Obstruction, ...]:
        """Everything solid that a ray touches or nearly touches, the ground included."""
        solid = obstructions(self.places, self.layouts)
        return (*solid, *terrain_obstructions(self.layout, self.over_terrain))

    @cached_property
    def over_terrain(self) -> tuple[OverTerrain, ...]:
        """How the rays of every scan clear the terrain, gate by gate; nothing without one."""
        return over_terrain(self.exact_places, self.layouts)

    @cached_property
    def predicted(self) -> "Predicted":
        """Errors, budgets and effects: loaded when first asked for."""
        from planner.predicted import Predicted

        return Predicted(self.places, self.layout, self.exclusions, self.geometric_effects)

    @property
    def fidelity(self) -> tuple[Effect, ...]:
        """Every effect that could be left out, with its size here, and whether it is."""
        return self.predicted.fidelity

    @property
    def budgets(self) -> "tuple[Budget, ...]":
        """Uncertainty budget of the ten-minute means of every declared sector scan and every pair."""
        return self.predicted.budgets

    def errors(
        self,
        *,
        tier: "Tier | None" = None,
        sizes_deg: Sequence[float] | None = None,
        sizes_from: "SizesFrom" = "own",
        progress: "Progress | None" = None,
    ) -> "tuple[ErrorCurve, ...]":
        """Predicted error of every sector scan at each of its targets, for each size, then of every pair.

        Parameters
        ----------
        tier
            Default: turbulent where the site declares turbulence, else linear.
        sizes_deg
            Sector sizes [deg]; default: each scan's declared one and the usual smaller ones.
        sizes_from
            "own": each size is a scan of its own; "subset": the middle rays of the declared scan, at its timing.
        progress
            Gets the share of the work that is done for each curve, in the Monte Carlo tier.

        Raises
        ------
        InputError
            If a size does not fit a scan, or the site does not say what the tier needs.
        """
        return self.predicted.errors(tier=tier, sizes_deg=sizes_deg, sizes_from=sizes_from, progress=progress)

    @cached_property
    def default_errors(self) -> "tuple[ErrorCurve, ...]":
        """The errors by the default tier and sizes, once."""
        return self.errors()

    def trades(self, *, rng: "Generator", progress: "Progress | None" = None) -> "tuple[Trade, ...]":
        """Time and error of every cheaper way on this machine: each call measures anew."""
        from planner.tradeoff import trades

        airs = self.predicted.airs
        return trades(self.exact_places, airs[0] if airs else None, rng=rng, progress=progress)

    def recommendation(self, curve: "ErrorCurve") -> "Recommendation":
        """The recommended sector size of a curve, with its reason."""
        from planner.sector_size import recommend

        return recommend(curve, self.site.tolerance)

    @cached_property
    def wanted(self) -> SectorSet:
        """The wind directions that count."""
        return wanted_directions(self.site)

    @cached_property
    def prevailing_deg(self) -> float:
        """Where the wanted wind mostly comes from [deg]; NaN where from everywhere alike."""
        return prevailing_deg(self.site, self.wanted)

    def largest_gust_mps(self, layout: ScanLayout) -> float:
        """The fastest wanted wind with its gusts, at a scan's fastest target [m/s]."""
        from planner.wind_climate import largest_gust_mps

        return largest_gust_mps(self.site, layout.targets)

    @cached_property
    def longitude_latitude_deg(self) -> tuple[float, float]:
        """Where the site is [deg east, deg north]."""
        longitude, latitude, _ = self.places.frame.geographic(self.places.origin_m)
        return float(longitude), float(latitude)

    @cached_property
    def convergence_deg(self) -> float:
        """Meridian convergence in the middle of the site [deg]."""
        return float(self.places.frame.convergence_deg(self.places.origin_m))

    @cached_property
    def from_meridian_deg(self) -> float | None:
        """Distance in longitude from the CRS' central meridian [deg]; None where it has none."""
        meridian_deg = self.places.frame.central_meridian_deg
        if meridian_deg is None:
            return None
        return abs(float(wrap_180_deg(self.longitude_latitude_deg[0] - meridian_deg)))

    def axis_from_wind_deg(self, layout: ScanLayout) -> float | None:
        """Angle between a sector's axis and the prevailing wind's line [deg], 0 to 90.

        None for other scans, and for a wind that comes from everywhere alike.
        """
        if layout.spec.type != "sector" or self.prevailing_deg != self.prevailing_deg:
            return None
        apart = abs(float(difference_deg(layout.axis_azimuth_deg, self.prevailing_deg)))
        return min(apart, 180.0 - apart)

    def near_wakes(self, exclusion: Exclusion) -> tuple[Near, ...]:
        """Each turbine's and obstacle's distance from what a scan measures, in its own diameters."""
        return near_wakes(self.places, self.layout[exclusion.scan], exclusion.target)
