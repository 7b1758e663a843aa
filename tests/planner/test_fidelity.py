"""What is modelled and what is left out: sizes against formulas that stand elsewhere, and the user's word."""

from pathlib import Path

import pytest

from geometry.effects import model_error_m
from planner.files.yaml_site import load_site
from planner.plan import Plan

EXAMPLES = Path(__file__).parents[2] / "examples"


def plan_of(name="hovsore", **changes):
    site = load_site(EXAMPLES / name / "site.yaml")
    return Plan(site.model_copy(update=changes))


@pytest.fixture(scope="module")
def effects():
    return {effect.name: effect for effect in plan_of().fidelity}


def test_convergence_is_the_difference_of_grid_and_geodesic_azimuth_at_the_mast(effects):
    """Physics, section 1: 233.091 against 232.400 degrees over 1613.7 m."""
    assert effects["convergence"].size == pytest.approx(1613.74 * 0.691 * 3.14159265 / 180, rel=2e-3)
    assert effects["convergence"].modelled


def test_curvature_and_refraction_are_left_out_below_half_a_metre(effects):
    assert effects["curvature"].size == pytest.approx(1613.74**2 / 2 / 6_371_000, rel=1e-3)
    assert effects["refraction"].size == pytest.approx(0.13 * effects["curvature"].size, rel=1e-6)
    assert not effects["curvature"].modelled


def test_no_vertical_wind_has_no_size_and_turbulence_has_the_largest(effects):
    assert effects["vertical-wind"].size == 0
    winds = [effect.size for effect in effects.values() if effect.unit == "m/s"]
    assert effects["turbulence"].size == max(winds)


def test_every_effect_is_modelled_exactly_where_it_exceeds_its_tolerance(effects):
    for effect in effects.values():
        if effect.name != "deflection-of-vertical":
            assert effect.modelled == (effect.size > effect.tolerance), effect.name


def test_the_chosen_earth_model_is_within_the_tolerance_and_the_next_cheaper_one_is_not():
    plan = plan_of()
    places = plan.exact_places
    target = plan.site.target_position_m("cup")
    assert plan.places.earth_model == "flat"
    head = plan.site.lidars[2].position
    assert (
        model_error_m(places.frame, head, target, "flat")
        < 0.5
        < model_error_m(places.frame, head, target, "flat-grid")
    )


def test_a_tighter_tolerance_models_more():
    tight = plan_of().site.tolerance.model_copy(update={"position_m": 0.05, "speed_mps": 0.001})
    plan = plan_of(tolerance=tight)
    assert {effect.name for effect in plan.fidelity if effect.modelled} >= {
        "convergence",
        "curvature",
        "shear",
    }
    assert plan.places.earth_model in ("curved", "exact")


def test_the_users_word_wins():
    everything = plan_of(fidelity="all")
    assert everything.places.earth_model == "exact"
    assert all(effect.modelled for effect in everything.fidelity if effect.name != "deflection-of-vertical")
    named = plan_of(fidelity=("convergence",))
    assert [effect.name for effect in named.fidelity if effect.modelled] == ["convergence"]
    assert named.errors(sizes_deg=(60,))[0].tier == "linear"  # turbulence was not named


def test_without_turbulence_its_effects_have_no_size_and_say_so():
    effects = {effect.name: effect for effect in plan_of("kassel").fidelity}
    assert effects["turbulence"].size is None
    assert "declares no turbulence" in effects["turbulence"].text


def test_leaving_shear_out_changes_the_error_by_no_more_than_its_size():
    """The list's promise: what is left out is as small as it says."""
    plan = plan_of()
    size = next(effect.size for effect in plan.fidelity if effect.name == "shear")
    without = plan.errors(tier="linear", sizes_deg=(60,))[0].sizes[0].values["speed_bias_mps"]
    whole = (
        plan_of(fidelity="all").errors(tier="linear", sizes_deg=(60,))[0].sizes[0].values["speed_bias_mps"]
    )
    assert 0 < abs(whole - without) <= size * 1.05
