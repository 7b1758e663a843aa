"""What a plan predicts: errors per sector size, uncertainty budgets and the size of what is left out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from geometry.angles import SectorSet
from geometry.disturbed import any_of
from planner.budget import Budget, mast_of, ten_minute_budget
from planner.error_curve import SizesFrom, default_sizes, default_tier, pair_curve, sector_curve
from planner.error_model import air_of_pair, air_of_scan
from planner.error_nouns import ErrorCurve
from planner.error_simulated import Progress
from planner.exclusion import Exclusion
from planner.fidelity import Effect, left_out
from planner.fidelity_wind import Air, wind_effects
from planner.places import Places
from planner.ray_sets import own_scan
from planner.scan_layout import ScanLayout
from planner.site import Pair
from reconstruct.prediction import Tier


@dataclass(frozen=True)
class Predicted:
    """Scans and wakes of a site, and what follows from them for the wind that is retrieved."""

    places: Places
    layout: Mapping[str, ScanLayout]
    exclusions: tuple[Exclusion, ...]
    geometric_effects: tuple[Effect, ...]

    @cached_property
    def fidelity(self) -> tuple[Effect, ...]:
        """Every effect that could be left out, with its size here, and whether it is."""
        return (*self.geometric_effects, *wind_effects(self.places.site, self.airs))

    @cached_property
    def declared_airs(self) -> tuple[tuple[str, str, Air], ...]:
        """Every sector scan and pair as declared, with its target, in the middle of the wind's speeds."""
        scans = [
            (item.scan, item.target, air_of_scan(self.places, layout, layout.scan, item))
            for item, layout in self._sectors
        ]
        pairs = [
            (pair.name, pair.target, air_of_pair(self.places, pair, *self._pair(pair)))
            for pair in self.places.site.pairs
        ]
        return (*scans, *pairs)

    @cached_property
    def airs(self) -> tuple[Air, ...]:
        """The same, and every sector scan at its narrowest size, which feels most effects most."""
        narrow = [
            air_of_scan(self.places, layout, own_scan(layout, default_sizes(layout)[-1]), item)
            for item, layout in self._sectors
        ]
        return (*(air for _, _, air in self.declared_airs), *narrow)

    @cached_property
    def budgets(self) -> tuple[Budget, ...]:
        """Uncertainty budget of the ten-minute means of every declared sector scan and every pair."""
        return tuple(
            ten_minute_budget(name, target, air, mast_of(self.places, target))
            for name, target, air in self.declared_airs
        )

    def errors(
        self,
        *,
        tier: Tier | None = None,
        sizes_deg: Sequence[float] | None = None,
        sizes_from: SizesFrom = "own",
        progress: Progress | None = None,
    ) -> tuple[ErrorCurve, ...]:
        """Predict every sector scan at each of its targets, for each size, then every pair: see `Plan.errors`."""
        sectors = self.sector_errors(tier=tier, sizes_deg=sizes_deg, sizes_from=sizes_from, progress=progress)
        return (*sectors, *self.pair_errors(tier=tier, progress=progress))

    def sector_errors(
        self,
        *,
        tier: Tier | None = None,
        sizes_deg: Sequence[float] | None = None,
        sizes_from: SizesFrom = "own",
        progress: Progress | None = None,
    ) -> tuple[ErrorCurve, ...]:
        """Predict every sector scan at each of its targets, for each size."""
        return tuple(
            sector_curve(
                self.places,
                layout,
                item,
                tier=tier or self._tier,
                sizes_deg=sizes_deg,
                sizes_from=sizes_from,
                left_out=left_out(self.fidelity),
                progress=progress,
            )
            for item, layout in self._sectors
        )

    def pair_errors(
        self, *, tier: Tier | None = None, progress: Progress | None = None
    ) -> tuple[ErrorCurve, ...]:
        """Predict every pair at its target."""
        return tuple(
            pair_curve(
                self.places,
                pair,
                *self._pair(pair),
                tier=tier or self._tier,
                left_out=left_out(self.fidelity),
                progress=progress,
            )
            for pair in self.places.site.pairs
        )

    @property
    def _tier(self) -> Tier:
        return default_tier(self.places.site, left_out(self.fidelity))

    @cached_property
    def _sectors(self) -> tuple[tuple[Exclusion, ScanLayout], ...]:
        """Every sector scan at each of its targets."""
        each = [(item, self.layout[item.scan]) for item in self.exclusions]
        return tuple((item, layout) for item, layout in each if layout.spec.type == "sector")

    def _pair(self, pair: Pair) -> tuple[tuple[ScanLayout, ...], SectorSet]:
        """The scans of a pair, and the directions in which a wake touches what any of them measures."""
        met = [item for item in self.exclusions if item.scan in pair.scans and item.target == pair.target]
        return tuple(self.layout[name] for name in pair.scans), any_of(item.excluded for item in met)
