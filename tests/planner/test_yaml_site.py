"""A site file: what is read, and how each fault is told."""

import io
import json
import re
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis.strategies import DataObject, booleans, data, sampled_from
from ruamel.yaml import YAML

from geometry.errors import InputError
from planner.assumptions import assumptions
from planner.files.yaml_site import load_site, parse_site
from planner.files.yaml_tree import Tree
from planner.site import PointsScan, SectorScan
from planner.wind_rose import load_rose

ROOT = Path(__file__).resolve().parents[2]

GOOD = """\
name: Moor
crs: EPSG:32632
ground_height_m: 5
lidars:
  - name: A
    position: [447450.5, 6256541.1, 4.1]
    instrument: windscanner-200s
  - name: B
    position: [448937.7, 6256404.9, 5.4]
    instrument: {name: mine, pulses: [{pulse_ns: 200, pulse_repetition_hz: 20000}]}
masts:
  - {name: mast, position: [447647.4, 6255435.8, 4.8], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4}
  - {name: k, lidar: B, target: cup, type: stare, accumulation_s: 0.5}
pairs:
  - {name: dual, scans: [s, k], target: cup}
wind:
  weibull: {scale_mps: 8.9, shape: 2.75}
"""


def message(text: str) -> str:
    """What the user reads."""
    with pytest.raises(InputError) as caught:
        parse_site(text, name="bad.yaml")
    return str(caught.value)


def faults(text: str) -> list[str]:
    """The faults, one a line, without the heading."""
    return message(text).splitlines()[1:]


def test_a_good_file_is_read_and_defaults_are_filled_in() -> None:
    site = parse_site(GOOD)
    assert site.lidar("B").device.name == "mine"
    assert site.lidar("A").north == "true"
    assert isinstance(site.scan("s"), SectorScan)
    assert site.target_position_m("cup") == pytest.approx((447647.4, 6255435.8, 124.8))


# old text, new text, line of the fault, key, what came, part of what is allowed
FAULTS = [
    ("height_m: 116.5", 'height_m: "116.5"', 12, "masts[0].height_m", "'116.5'", "a number"),
    ("height_m: 116.5", "height_m: true", 12, "masts[0].height_m", "true", "a number"),
    ("height_m: 116.5", "height_m: 1" + 400 * "0", 12, "masts[0].height_m", "1000", "a number"),
    ("height_m: 116.5", "height_m: -3", 12, "masts[0].height_m", "-3", "a number above 0"),
    ("height_m: 116.5", "height_m: null", 12, "masts[0].height_m", "null (an empty value)", "a number"),
    ("4.1]", ".nan]", 6, "lidars[0].position[2]", ".nan", "a finite number"),
    ("4.1]", ".inf]", 6, "lidars[0].position[2]", ".inf", "a finite number"),
    (", 4.1]", "]", 6, "lidars[0].position", "[447450.5, 6256541.1]", "[easting, northing, height]"),
    (", 4.1]", ", 4.1, 7]", 6, "lidars[0].position", "[447450.5, 6256541.1, 4.1, 7]", "three numbers"),
    ("[447450.5, 6256541.1, 4.1]", "here", 6, "lidars[0].position", "'here'", "[easting, northing, height]"),
    (
        "windscanner-200s",
        "windscaner-200s",
        7,
        "lidars[0].instrument",
        "'windscaner-200s'",
        "'windscanner-200s'",
    ),
    (
        "pulse_repetition_hz: 20000",
        "",
        10,
        "lidars[1].instrument.pulses[0].pulse_repetition_hz",
        "nothing",
        "a number",
    ),
    ("mast: mast", "mast: most", 14, "targets[0].mast", "'most'", "the name of a mast: mast"),
    ("mast: mast, ", "", 14, "targets[0]", "nothing", "either `mast` or `position`"),
    (", height_m: 120", "", 14, "targets[0].height_m", "nothing", "a height above the mast's base"),
    ("lidar: A", "lidar: C", 16, "scans[0].lidar", "'C'", "A, B"),
    ("lidar: A, target: cup", "lidar: A, target: cop", 16, "scans[0].target", "'cop'", "Did you mean 'cup'?"),
    (
        "lidar: A, target: cup",
        "lidar: A",
        16,
        "scans[0].target",
        "nothing",
        "`target`, or `azimuth_head_deg`",
    ),
    ("scans: [s, k]", "scans: [s, q]", 19, "pairs[0].scans[1]", "'q'", "s, k"),
    ("scans: [s, k]", "scans: [s]", 19, "pairs[0].scans", "['s']", "at least 2"),
    (
        "scans: [s, k]",
        "columns: 3, scans: [s, k]",
        19,
        "pairs[0].columns",
        "3",
        "only with three scans or more",
    ),
    ("name: B", "name: A", 8, "lidars[1].name", "'A'", "a name that no other lidar has"),
    ("name: k", "name: s", 17, "scans[1].name", "'s'", "a name that no other scan has"),
    ("name: B", "name: 7", 8, "lidars[1].name", "7", "text"),
    ("sector_deg: 60", "sector_deg: 0", 16, "scans[0].sector_deg", "0", "above 0 and at most 360"),
    ("sector_deg: 60", "sector_deg: 361", 16, "scans[0].sector_deg", "361", "above 0 and at most 360"),
    ("step_deg: 2", "step_deg: 7", 16, "scans[0].step_deg", "7", "a step that divides sector_deg evenly"),
    (
        "accumulation_s: 0.4",
        "accumulation_s: -0.4",
        16,
        "scans[0].accumulation_s",
        "-0.4",
        "a number above 0",
    ),
    (
        "type: sector",
        "type: sectr",
        16,
        "scans[0].type",
        "'sectr'",
        "sector, ppi, rhi, stare, raster, points",
    ),
    ("type: stare, ", "", 17, "scans[1].type", "nothing", "sector, ppi, rhi, stare, raster, points"),
    ("EPSG:32632", "32632", 2, "crs", "32632", "text such as EPSG:32632"),
    (
        "  weibull: {scale_mps: 8.9, shape: 2.75}",
        "  weibull: [8.9, 2.75]",
        21,
        "wind.weibull",
        "[8.9, 2.75]",
        "a mapping",
    ),
    (
        "2.75}",
        "2.75}\n  speeds_mps: [8]",
        22,
        "wind.speeds_mps",
        "[8]",
        "one of weibull, speeds_mps and rose",
    ),
    (
        "2.75}",
        "2.75}\n  directions_deg: [[90, 90]]",
        22,
        "wind.directions_deg[0]",
        "[90, 90]",
        "two different directions",
    ),
    ("2.75}", "2.75}\n  directions_deg: [[90, 400]]", 22, "wind.directions_deg[0][1]", "400", "at most 360"),
    (
        "2.75}",
        "2.75}\n  speed_range_mps: [9, 4]",
        22,
        "wind.speed_range_mps",
        "[9, 4]",
        "the lower one first",
    ),
    ("ground_height_m: 5", "north: grid", 3, "north", "this key is not known here", "ground_height_m"),
    (
        "height_m: 116.5",
        "hight_m: 116.5",
        12,
        "masts[0].hight_m",
        "this key is not known",
        "Did you mean 'height_m'?",
    ),
]


@pytest.mark.parametrize(("old", "new", "line", "key", "came", "allowed"), FAULTS)
def test_a_fault_names_line_key_value_and_what_is_allowed(
    old: str, new: str, line: int, key: str, came: str, allowed: str
) -> None:
    assert old in GOOD
    told = [text for text in faults(GOOD.replace(old, new, 1)) if f": {key}: " in text]
    assert len(told) == 1
    assert told[0].startswith(f"  bad.yaml:{line}: {key}: {came}")
    assert allowed in told[0]


def test_swapped_easting_and_northing_are_recognised() -> None:
    (told,) = faults(GOOD.replace("[447450.5, 6256541.1, 4.1]", "[6256541.1, 447450.5, 4.1]"))
    assert "Easting and northing are swapped" in told
    assert "longitude 6 to 12°, latitude 0 to 84°" in told


def test_a_position_off_the_crs_says_where_it_is() -> None:
    """The place of a digit too many is told in degrees, which a second formula gives to first order."""
    (told,) = faults(GOOD.replace("[447450.5,", "[1300000.0,"))
    assert "lidars[0].position: [1300000.0, 6256541.1, 4.1] came" in told
    longitude = float(re.findall(r"at longitude ([\d.]+)°", told)[0])
    # 800 km / (111.32 km · cos 56.4°) = 13.0° east of 9° E, to first order
    assert longitude == pytest.approx(22.0, abs=0.6)


@pytest.mark.parametrize(
    ("crs", "reason"),
    [
        ("EPSG:4326", "geographic"),
        ("EPSG:999999", "does not know"),
        ("UTM 32", "does not know"),
        ("EPSG:2225", "foot"),
        ("EPSG:4978", "not projected"),
    ],
)
def test_a_crs_that_cannot_carry_a_site_is_refused(crs: str, reason: str) -> None:
    (told,) = faults(GOOD.replace("EPSG:32632", crs))
    assert told.startswith("  bad.yaml:2: crs: ")
    assert crs in told
    assert reason in told


def test_a_key_given_twice_is_told_with_both_lines() -> None:
    (told,) = faults(GOOD.replace("ground_height_m: 5", "crs: EPSG:25832"))
    assert told == "  bad.yaml:3: crs: this key is given twice, first on line 2; allowed: each key once."


def test_north_true_may_be_a_yaml_boolean_but_false_is_nothing() -> None:
    text = GOOD.replace("instrument: windscanner-200s", "instrument: windscanner-200s\n    north: true")
    assert parse_site(text).lidar("A").north == "true"
    (told,) = faults(text.replace("north: true", "north: false"))
    assert told.endswith("lidars[0].north: false came; allowed: true or grid")


def test_yaml_is_version_1_2() -> None:
    """1e1 is a number, 010 is ten and not eight, and `no` is a word."""
    site = parse_site(GOOD.replace("height_m: 120", "height_m: 12e1").replace("name: Moor", "name: no"))
    assert site.name == "no"
    assert site.target("cup").height_m == 120
    assert parse_site(GOOD.replace("ground_height_m: 5", "ground_height_m: 010")).ground_m == 10


def test_all_faults_come_in_one_pass_in_the_order_of_the_file() -> None:
    """Looked at and found to read well; a change of wording shows here."""
    text = """\
name: Bad
crs: EPSG:32632
hight_datum: ellipsoidal
lidars:
  - name: A
    position: [6256541.1, 447450.5, 4.1]
    instrument: windcube-20s
    instrument: windcube-200s
  - {name: A, position: [447450.5, .nan, 4.1], instrument: halo-streamline, north: magnetic}
targets:
  - {name: cup, mast: mast, height_m: 120}
scans:
  - {name: s, lidar: Z, target: cupp, type: sector, sector_deg: 400, step_deg: 2, accumulation_s: -1}
"""
    assert (
        message(text) + "\n"
        == """\
bad.yaml: 12 faults in this site file; nothing was done.
  bad.yaml:3: hight_datum: this key is not known here; allowed: name, crs, height_datum, \
geoid_undulation_m, ground_height_m, terrain, lidars, masts, turbines, obstacles, hard_targets, \
targets, scans, pairs, wind, wakes, areas, tolerance, fidelity. Did you mean 'height_datum'?
  bad.yaml:6: lidars[0].position: [6256541.1, 447450.5, 4.1] came; allowed: [easting, northing, height] \
in the area of use of EPSG:32632: longitude 6 to 12°, latitude 0 to 84°. Easting and northing are \
swapped: exchange the first two numbers.
  bad.yaml:7: lidars[0].instrument: 'windcube-20s' came; allowed: windscanner-200s, windcube-100s, \
windcube-200s, windcube-400s, halo-streamline, halo-streamline-xr, or a mapping with the instrument's \
own numbers. Did you mean 'windcube-200s'?
  bad.yaml:8: lidars[0].instrument: this key is given twice, first on line 7; allowed: each key once.
  bad.yaml:9: lidars[1].name: 'A' came; allowed: a name that no other lidar has (lidars[0] has it \
already)
  bad.yaml:9: lidars[1].north: 'magnetic' came; allowed: true or grid
  bad.yaml:9: lidars[1].position[1]: .nan came; allowed: a finite number
  bad.yaml:11: targets[0].mast: 'mast' came; allowed: the name of a mast, and none is declared
  bad.yaml:13: scans[0].accumulation_s: -1 came; allowed: a number above 0
  bad.yaml:13: scans[0].lidar: 'Z' came; allowed: the name of a lidar: A
  bad.yaml:13: scans[0].sector_deg: 400 came; allowed: a number above 0 and at most 360
  bad.yaml:13: scans[0].target: 'cupp' came; allowed: the name of a target: cup. Did you mean 'cup'?
"""
    )


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("name: [1\ncrs: x\n", 2),
        ("name: a\n\tcrs: b\n", 2),
        ("name: a\n  crs: b\n", 2),
        ("a: 1\n---\nb: 2\n", 2),
    ],
)
def test_a_yaml_syntax_error_is_told_with_its_line(text: str, line: int) -> None:
    (told,) = faults(text)
    assert told.startswith(f"  bad.yaml:{line}: ")
    assert "YAML" in told


@pytest.mark.parametrize("text", ["", "# only a comment\n", "- a\n- b\n", "just text\n"])
def test_a_file_that_is_no_mapping_is_refused(text: str) -> None:
    assert "a site file is a mapping" in message(text)


def test_an_alias_that_holds_itself_is_refused() -> None:
    assert "an alias that holds itself" in message("name: &a [*a]\ncrs: EPSG:32632\n")


def test_a_tag_that_would_make_an_object_is_refused() -> None:
    assert "plain values" in message("name: !!python/object:os.system ls\ncrs: EPSG:32632\n")


def test_files_that_cannot_be_site_files_are_refused_in_words(tmp_path: Path) -> None:
    binary, latin = tmp_path / "site.png", tmp_path / "latin.yaml"
    binary.write_bytes(b"\x89PNG\0\0")
    latin.write_bytes("name: x\ncrs: Høvsøre\n".encode("latin-1"))
    for path, words in (
        (tmp_path / "none.yaml", "there is no such file"),
        (tmp_path, "this is a folder"),
        (binary, "a binary file came"),
        (latin, "latin.yaml:2: byte 0xf8 came, which is not UTF-8"),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            load_site(path)


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert load_site(path) == parse_site(GOOD)


def test_standard_input_is_read_for_a_dash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(GOOD.encode())))
    assert load_site("-").name == "Moor"


def test_files_that_a_site_names_are_looked_for_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(
        GOOD.replace("weibull: {scale_mps: 8.9, shape: 2.75}", "rose: rose.csv"), encoding="utf-8"
    )
    with pytest.raises(
        InputError, match=r"site.yaml:21: wind.rose: 'rose.csv' came; allowed: a file that exists"
    ):
        load_site(path)
    (tmp_path / "rose.csv").write_text("direction_deg,share\n", encoding="utf-8")
    site = load_site(path)
    assert site.wind is not None
    assert site.wind.rose == tmp_path / "rose.csv"


def test_a_points_scan_takes_a_list_of_targets() -> None:
    text = GOOD.replace("type: stare, ", "type: points, targets: [cup], ").replace(
        "lidar: B, target: cup", "lidar: B"
    )
    scan = parse_site(text).scan("k")
    assert isinstance(scan, PointsScan)
    assert scan.targets == ("cup",)


@pytest.mark.parametrize("name", ["hovsore", "kassel"])
def test_the_examples_are_valid(name: str) -> None:
    load_site(ROOT / "examples" / name / "site.yaml")


ODD = (
    None,
    True,
    -1,
    0,
    1e400,
    float("nan"),
    10**400,
    "x",
    "",
    "\u0007",
    [],
    {},
    [[]],
    {"a": {}},
    [1, 2, 3],
    "2014-04-30",
)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(data())
def test_whatever_stands_in_a_site_it_is_read_or_refused_in_words(draw: DataObject) -> None:
    """One place of a good site gets an odd value, a misspelt key, or goes: never a crash."""
    raw = YAML(typ="safe", pure=True).load((ROOT / "examples/hovsore/site.yaml").read_text(encoding="utf-8"))
    place = draw.draw(sampled_from([place for place in Tree(json.dumps(raw)).lines if place]))
    holder = raw
    for part in place[:-1]:
        holder = holder[part]
    if draw.draw(booleans()):
        holder[place[-1]] = draw.draw(sampled_from(ODD))
    elif isinstance(holder, dict):
        holder[f"{place[-1]}_"] = holder.pop(place[-1])
    else:
        del holder[place[-1]]
    try:
        parse_site(json.dumps(raw), name="odd.yaml")
    except InputError as error:
        heading, *told = str(error).splitlines()
        assert heading.startswith("odd.yaml: ")
        assert told
        assert all(text.startswith("  odd.yaml:1: ") for text in told)


@pytest.mark.parametrize(
    ("pair", "told"),
    [("[s, s]", "it is named twice"), ("[s, t]", "s is a scan of A too")],
)
def test_a_pair_needs_two_lidars(pair: str, told: str) -> None:
    other = "  - {name: t, lidar: A, target: cup, type: stare, accumulation_s: 0.5}\npairs:"
    (fault,) = faults(GOOD.replace("pairs:", other).replace("[s, k]", pair))
    assert fault.startswith(f"  bad.yaml:20: pairs[0].scans[1]: '{pair[4]}' came")
    assert told in fault


def test_a_terrain_that_is_no_raster_is_told_at_its_line(tmp_path: Path) -> None:
    pytest.importorskip("rasterio")
    (tmp_path / "hills.tif").write_text("no raster", encoding="utf-8")
    (tmp_path / "site.yaml").write_text(
        GOOD.replace("ground_height_m: 5", "terrain: {file: hills.tif}"), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r":3: terrain\.file: 'hills\.tif' came; allowed: a raster"):
        load_site(tmp_path / "site.yaml")


def test_what_is_taken_for_pulse_head_wakes_and_rose_is_told(tmp_path: Path) -> None:
    (tmp_path / "rose.csv").write_text("direction_deg,share\n0,40\n180,60\n", encoding="utf-8")
    turbine = "turbines: [{name: W, position: [447700, 6255000, 5], hub_height_m: 80, rotor_diameter_m: 90}]"
    text = GOOD.replace("weibull: {scale_mps: 8.9, shape: 2.75}", "rose: rose.csv") + turbine
    text = text.replace("[{pulse_ns: 200, pulse_repetition_hz: 20000}]", "[]")
    told = " ".join(assumptions(parse_site(text, folder=tmp_path)))
    assert "no Weibull columns: all speeds from 4 to 25 m/s count alike" in told
    assert "model union, decay 0.075 (on land), up to 20 diameters" in told
    assert "(mine) says: a pulse of 200 ns and a probe of 64 FFT points taken for k" in told
    assert "head of mine: it turns at any speed" in told


@pytest.mark.parametrize(("shares", "read"), [((0.4, 0.595), True), ((40, 60.9), True), ((10, 20), False)])
def test_shares_of_a_rose_add_up(tmp_path: Path, shares: tuple[float, float], read: bool) -> None:
    path = tmp_path / "rose.csv"
    path.write_text(f"direction_deg,share\n0,{shares[0]}\n180,{shares[1]}\n", encoding="utf-8")
    if read:
        assert load_rose(path).share.sum() == pytest.approx(1.0)
        return
    with pytest.raises(InputError, match="add up to 30"):
        load_rose(path)
