"""Generated worlds: the areas that their docstrings call free are free."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools
from groundmap.errors import FileFormatError, InputError, SettingsError
from groundmap.simulate.world import World
from groundmap.simulate.worlds import (
    GENERATORS,
    Corridor,
    Empty,
    Forest,
    MapImage,
    Parking,
    Rooms,
    Spiral,
    Warehouse,
)
from groundmap.simulate.worlds.image import outlines
from groundmap.simulate.worlds.warehouse import PALLET
from strategies import rngs

ROS_MAPS = Path(__file__).parents[3] / "shared" / "data" / "ros_maps"
SEEDLESS = {"empty", "spiral", "image"}
STEP, ROBOT = 0.15, 2.0
HAIR = 1e-6  # rounding, where something may just touch


def seeded(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def defaults(name: str, folder: Path) -> dict[str, Any]:
    """Return the settings that a generator requires."""
    if name != "image":
        return {}
    (folder / "some.map").write_text("type octile\nheight 2\nwidth 3\nmap\n@@.\n.T@\n")
    return {"path": folder / "some.map"}


def pictured(world: World) -> list[tuple[str, float, float]]:
    return [(solid.outline.wkt, solid.bottom, solid.top) for solid in world.solids]


def clearance(world: World, place: shapely.Geometry) -> float:
    return float(world.obstacles(STEP, ROBOT).distance(place))


def connected(world: World, places: list[shapely.Point], radius: float) -> bool:
    """Return whether a robot reaches each place from each other within the bounds."""
    hit = world.obstacles(STEP, ROBOT).buffer(radius, quad_segs=32)
    free = shapely.get_parts(shapely.box(*world.bounds) - hit)
    return any(all(part.contains(place) for place in places) for part in free)


# All


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_a_seed_always_gives_the_same_world(name: str, tmp_path: Path) -> None:
    made = GENERATORS[name](**defaults(name, tmp_path))
    first, again = made.make(seeded(1)), made.make(seeded(1))
    assert pictured(first) == pictured(again)
    assert first.bounds == again.bounds
    assert (pictured(first) == pictured(made.make(seeded(2)))) == (name in SEEDLESS)


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_no_solid_is_outside_the_bounds(name: str, tmp_path: Path) -> None:
    world = GENERATORS[name](**defaults(name, tmp_path)).make(seeded())
    ground = shapely.box(*world.bounds).buffer(HAIR)
    assert all(ground.covers(solid.outline) for solid in world.solids)


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_no_two_solids_of_a_height_overlap(name: str, tmp_path: Path) -> None:
    solids = GENERATORS[name](**defaults(name, tmp_path)).make(seeded()).solids
    for height in {solid.top for solid in solids}:
        alike = [solid.outline for solid in solids if solid.top == height]
        total = sum(outline.area for outline in alike)
        assert shapely.union_all(alike).area == pytest.approx(total)


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_densities_are_those_of_the_settings(name: str, tmp_path: Path) -> None:
    values = {"ground_texture": 3.0, "ground_lines": 0.1}
    if name != "empty":
        values |= {"texture": 2.0, "lines": 0.0}
    world = GENERATORS[name](**values, **defaults(name, tmp_path)).make(seeded())
    assert (world.ground_texture, world.ground_lines) == (3.0, 0.1)
    assert {(solid.texture, solid.lines) for solid in world.solids} <= {(2.0, 0.0)}


@pytest.mark.parametrize("name", sorted(GENERATORS))
def test_every_field_has_a_description(name: str) -> None:
    assert all(field.description for field in GENERATORS[name].model_fields.values())


def test_an_unknown_setting_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"setting of Rooms, .* Did you mean 'columns'"):
        Rooms(colums=3)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("empty", {"bounds": (0, 0, 0, 5)}, "bounds: expected XMIN < XMAX"),
        ("rooms", {"room_depth": 1.3}, "room_depth: expected more than 1.4, to hold a door"),
        ("rooms", {"passage": 1.1}, "passage: expected at most the door_width, got 1.1"),
        ("corridor", {"width": 7}, "width: expected more than 7.2, to hold the corridor"),
        ("corridor", {"pillar_size": 1.3}, "corridor_width: expected more than 2.6, to hold two"),
        ("warehouse", {"aisle_width": 1.5}, "aisle_width: expected more than 1.6, to hold two"),
        ("warehouse", {"rack_length": 1}, "rack_length: expected more than 1.2, to hold a pallet"),
        ("parking", {"occupancy": 1.5}, "occupancy: expected less than or equal to 1"),
        ("forest", {"bounds": (0, 0, 2, 9)}, "bounds: expected sides of at least 2.9"),
        ("forest", {"bounds": (5, 0, 2, 9)}, "bounds: expected XMIN < XMAX"),
        ("forest", {"min_radius": 0.3}, "min_radius: expected at most max_radius, 0.25, got 0.3"),
        ("image", {"path": "a.map", "crop": (0, 3, 4, 3)}, "crop: expected XMIN < XMAX"),
    ],
)
def test_sizes_that_do_not_fit_each_other_are_refused(
    name: str, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(SettingsError, match=message):
        GENERATORS[name](**values)


# Each


def test_an_empty_world_is_traversable_everywhere() -> None:
    world = Empty(bounds=(-1, -2, 3, 4)).make(seeded())
    assert world.obstacles(STEP, ROBOT).is_empty
    assert world.bounds == (-1, -2, 3, 4)


@given(
    rngs(),
    st.builds(
        Rooms,
        columns=st.integers(1, 4),
        rows=st.integers(1, 3),
        room_width=st.floats(2.0, 9.0),
        room_depth=st.floats(2.0, 9.0),
        door_width=st.floats(1.0, 1.5),
        passage=st.floats(0.5, 1.0),
        boxes=st.just(8),
        loops=st.just(0.0),
    ),
)
def test_furnished_rooms_are_reachable_from_each_other(
    rng: np.random.Generator, rooms: Rooms
) -> None:
    world = rooms.make(rng)
    centres = [shapely.Point(centre) for centre in rooms.centres()]
    nearly = 0.97 * rooms.passage / 2  # the ways are rounded by polygons
    assert min(clearance(world, centre) for centre in centres) > nearly
    assert connected(world, centres, nearly)


def test_without_loops_the_doors_form_a_tree() -> None:
    bare = Rooms(columns=4, rows=3, boxes=0, loops=0)
    total = bare.make(seeded()).obstacles(STEP, ROBOT).area
    all_doors = bare.model_copy(update={"loops": 1.0}).make(seeded()).obstacles(STEP, ROBOT).area
    area_of_door = bare.door_width * bare.wall_thickness
    # 17 inner walls, of which 11 link 12 rooms.
    assert (total - all_doors) / area_of_door == pytest.approx(17 - 11)


def test_rooms_are_furnished_with_boxes_of_many_heights() -> None:
    world = Rooms(columns=2, rows=2, boxes=3).make(seeded())
    tops = {solid.top for solid in world.solids if solid.top < 2.5}
    assert len(tops) == 12
    assert all(0.4 <= top <= 1.5 for top in tops)


@given(rngs(), st.floats(1.0, 3.0), st.integers(0, 30), st.integers(0, 30))
def test_a_corridors_centre_line_is_free(
    rng: np.random.Generator, width: float, niches: int, pillars: int
) -> None:
    corridor = Corridor(corridor_width=width, niches=niches, pillars=pillars)
    world = corridor.make(rng)
    assert clearance(world, corridor.centre_line()) >= width / 2 - 0.4 - HAIR


def test_niches_take_from_the_walls_and_pilasters_add_to_them() -> None:
    def free(**values: Any) -> float:
        world = Corridor(length=20, width=12, corridor_width=2.5, **values).make(seeded())
        return float((shapely.box(*world.bounds) - world.obstacles(STEP, ROBOT)).area)

    plain = 20 * 12 - 15 * 7
    assert free(niches=0, pillars=0) == pytest.approx(plain)
    assert free(niches=1, pillars=0) == pytest.approx(plain + 1.2 * 0.5)
    assert free(niches=0, pillars=1) == pytest.approx(plain - 0.4 * 0.4)


@given(rngs(), st.integers(1, 5), st.integers(1, 3), st.floats(1.7, 4.0), st.floats(1.0, 4.0))
def test_aisles_and_cross_aisles_are_free_along_their_centre_lines(
    rng: np.random.Generator, racks: int, blocks: int, aisle: float, cross: float
) -> None:
    hall = Warehouse(racks=racks, blocks=blocks, aisle_width=aisle, cross_aisle=cross, pallets=40)
    world = hall.make(rng)
    y, x = hall.aisles(), hall.cross_aisles()
    beside = min(aisle / 2 - PALLET[1], cross / 2)  # the hall's walls end the lines
    along = [shapely.LineString([(x[0], at), (x[-1], at)]) for at in y]
    across = [shapely.LineString([(at, y[0]), (at, y[-1])]) for at in x]
    assert min(clearance(world, line) for line in along) >= beside - HAIR
    assert min(clearance(world, line) for line in across) >= min(aisle, cross) / 2 - HAIR


def test_only_racks_have_a_repeated_pattern() -> None:
    world = Warehouse(racks=2, blocks=3, bay=1.1, pallets=5).make(seeded())
    racks = [solid for solid in world.solids if solid.repeat]
    assert {(rack.repeat, rack.top) for rack in racks} == {(1.1, 2.2)}
    assert len(racks) == 6
    assert len(world.solids) == 6 + 5 + 1


@given(rngs(), st.floats(5.0, 60.0), st.floats(2.5, 8.0))
def test_the_road_is_free_from_end_to_end(
    rng: np.random.Generator, length: float, width: float
) -> None:
    world = Parking(length=length, road_width=width, occupancy=1).make(rng)
    middle = shapely.LineString([(0, 0), (length, 0)])
    assert clearance(world, middle) >= width / 2 - HAIR


def test_kerbs_are_ground_to_a_robot_with_higher_steps_only() -> None:
    world = Parking(length=30, occupancy=0, pole_spacing=100).make(seeded())
    strip = shapely.box(0, 4.75, 30, 6.65)  # the pavement on the left
    assert not world.obstacles(0.15, 2.0).intersects(strip)
    assert world.obstacles(0.10, 2.0).covers(strip)


def test_cars_are_parked_on_both_sides_and_apart() -> None:
    world = Parking(occupancy=1).make(seeded())
    cars = [solid.outline for solid in world.solids if solid.top == 1.5]
    sides = [car.centroid.y > 0 for car in cars]
    assert all(sum(side == left for side in sides) >= 9 for left in (True, False))
    gaps = [a.distance(b) for a in cars for b in cars if a is not b]
    assert min(gaps) >= 0.6 - HAIR


@given(rngs(), st.integers(0, 60), st.floats(0.4, 2.0), st.floats(0.0, 4.0))
def test_trees_keep_their_distance_from_each_other_the_edge_and_the_clearing(
    rng: np.random.Generator, trees: int, spacing: float, clearing: float
) -> None:
    world = Forest(
        bounds=(0, 0, 14, 11), trees=trees, spacing=spacing, clearing=clearing
    ).make(rng)  # fmt: skip
    trunks = [solid.outline for solid in world.solids]
    assert len(trunks) <= trees
    for index, trunk in enumerate(trunks):
        others = trunks[:index]
        assert not len(others) or shapely.distance(trunk, others).min() >= spacing - HAIR
        assert shapely.box(0, 0, 14, 11).exterior.distance(trunk) >= spacing - HAIR
        assert trunk.distance(shapely.Point(7, 5.5)) >= clearing - HAIR


@settings(max_examples=10)
@given(rngs())
def test_a_robot_that_fits_between_two_trees_reaches_the_whole_forest(
    rng: np.random.Generator,
) -> None:
    world = Forest(trees=200, spacing=1.0).make(rng)
    hit = world.obstacles(STEP, ROBOT).buffer(0.49)
    free = shapely.box(*world.bounds) - hit
    assert len(shapely.get_parts(free)) == 1


@given(st.floats(0.8, 4.0), st.floats(0.05, 0.5), st.integers(1, 4))
def test_a_spiral_is_free_along_its_centre_line_and_closed(
    width: float, wall: float, turns: int
) -> None:
    spiral = Spiral(corridor_width=width, wall_thickness=wall, turns=turns)
    world = spiral.make(seeded())
    assert clearance(world, spiral.centre_line()) == pytest.approx(width / 2)
    [walls] = world.solids
    [corridor] = walls.outline.interiors
    assert shapely.Polygon(corridor).contains(spiral.centre_line())


# Of images


def write_map(path: Path, blocked: Bools) -> Path:
    rows, cols = blocked.shape
    lines = ["".join("@" if cell else "." for cell in row) for row in blocked]
    path.write_text("\n".join(["type octile", f"height {rows}", f"width {cols}", "map", *lines]))
    return path


@given(rngs(), st.integers(1, 12), st.integers(1, 12), st.floats(0.0, 1.0))
def test_outlines_cover_the_blocked_cells_and_nothing_else(
    rng: np.random.Generator, rows: int, cols: int, share: float
) -> None:
    blocked = rng.uniform(size=(rows, cols)) < share
    pieces = outlines(blocked)
    assert all(isinstance(piece, shapely.Polygon) and piece.is_valid for piece in pieces)
    row, col = np.indices(blocked.shape)
    inside = shapely.contains_xy(shapely.union_all(pieces), col + 0.5, row + 0.5)
    np.testing.assert_array_equal(inside, blocked)
    assert sum(piece.area for piece in pieces) == blocked.sum()


def test_a_movingai_map_has_its_first_row_at_y_0(tmp_path: Path) -> None:
    path = write_map(tmp_path / "a.map", np.array([[0, 0, 1], [0, 0, 0]], dtype=bool))
    world = MapImage(path=path, resolution=0.5, height=1.2).make(seeded())
    [wall] = world.solids
    assert wall.outline.equals(shapely.box(1.0, 0.0, 1.5, 0.5))
    assert (wall.top, world.bounds) == (1.2, (0.0, 0.0, 1.5, 1.0))


def test_a_crop_does_not_move_cells(tmp_path: Path) -> None:
    blocked = seeded().uniform(size=(30, 40)) < 0.3
    path = write_map(tmp_path / "a.map", blocked)
    whole = MapImage(path=path, resolution=0.1).make(seeded())
    crop = (0.5, 0.3, 2.7, 1.9)
    part = MapImage(path=path, resolution=0.1, crop=crop).make(seeded())
    assert part.bounds == pytest.approx(crop)
    kept = whole.obstacles(STEP, ROBOT) & shapely.box(*part.bounds)
    assert (kept ^ part.obstacles(STEP, ROBOT)).area < 1e-9


def test_the_error_for_a_crop_outside_the_map_states_its_bounds(tmp_path: Path) -> None:
    path = write_map(tmp_path / "a.map", np.zeros((2, 3), dtype=bool))
    made = MapImage(path=path, crop=(3, 0, 9, 2))
    with pytest.raises(InputError, match=r"crop: .* reaches from \(0, 0\) to \(3, 2\)"):
        made.make(seeded())


def test_a_map_that_is_missing_is_reported_when_the_world_is_made(tmp_path: Path) -> None:
    made = MapImage(path=tmp_path / "gone.yaml")
    with pytest.raises(FileFormatError, match=r"gone.yaml: expected a YAML file, got no file of"):
        made.make(seeded())


@pytest.mark.skipif(not ROS_MAPS.is_dir(), reason="the ROS maps are not part of the project")
def test_a_published_map_is_at_the_origin_of_its_yaml() -> None:
    world = MapImage(path=ROS_MAPS / "tb3_sandbox.yaml").make(seeded())
    assert world.bounds == pytest.approx((-10.0, -10.0, 9.2, 9.2))
    # The robot of Nav2's tutorial starts at (-2, -0.5), among nine pillars 1.1 m apart.
    assert clearance(world, shapely.Point(-2.0, -0.5)) > 0.3
    for x in (-1.1, 0.0, 1.1):
        for y in (-1.1, 0.0, 1.1):
            assert clearance(world, shapely.Point(x, y)) < 0.2
