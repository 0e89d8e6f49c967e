"""Every tile has one owner, whatever happens to members and loads."""

from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.cluster.tiles.tile_owners import Loads, OwnerTable, revised_table
from deconflict.cluster.tiles.tiles import Area, Grid, Tile
from ingest.batch import FloorPoint

SIDE_M, HOT_PER_S = 64.0, 100.0
ROOTS = [Tile("hall", column, 0) for column in range(4)]


def settled(table: OwnerTable, members: list[str], per_s: dict[Tile, float], rounds: int = 60) -> OwnerTable:
    """After so many rounds, the load of a tile shared out evenly among its quarters."""
    for _ in range(rounds):
        loads: Loads = {member: {tile: load_of(tile, per_s) for tile in table.of(member)} for member in members}
        table = revised_table(table, loads, ROOTS, SIDE_M, HOT_PER_S)
    return table


def load_of(tile: Tile, per_s: dict[Tile, float]) -> float:
    return per_s.get(tile.root, 0.0) / float(4 ** len(tile.path))


def test_the_tiles_of_a_lost_member_go_to_the_others() -> None:
    table = settled(OwnerTable(), ["a", "b", "c"], {})
    assert {table.of(name) for name in "abc"} != {frozenset()}
    after = settled(table, ["a", "c"], {}, 1)
    assert after.owners.keys() == table.owners.keys()
    assert set(after.owners.values()) == {"a", "c"}
    assert table.of("a") <= after.of("a")
    assert after.global_engine in ("a", "c")


def test_a_hot_tile_is_split_and_shared() -> None:
    busy = {ROOTS[0]: 350.0}
    table = settled(OwnerTable(), ["a", "b"], busy)
    quarters = [tile for tile in table.owners if tile.root == ROOTS[0]]
    assert sorted(quarters) == sorted(ROOTS[0].quarters())
    assert {table.owners[tile] for tile in quarters} == {"a", "b"}


def test_the_next_tile_moves_once_the_last_moved_tile_was_measured() -> None:
    table = OwnerTable(dict.fromkeys(ROOTS, "a"), "a")
    loads: dict[str, dict[Tile, float]] = {"a": dict.fromkeys(ROOTS, 20.0), "b": {}}
    moved = revised_table(table, loads, ROOTS, SIDE_M, HOT_PER_S)
    (first,) = moved.of("b")
    assert revised_table(moved, loads, ROOTS, SIDE_M, HOT_PER_S) == moved
    assert len(revised_table(moved, loads | {"b": {first: 20.0}}, ROOTS, SIDE_M, HOT_PER_S).of("b")) == 2


def test_a_tile_does_not_move_if_that_only_reverses_the_difference() -> None:
    light, heavy, beside = ROOTS[:3]
    table = OwnerTable({light: "a", heavy: "a", beside: "b"}, "a")
    loads: Loads = {"a": {light: 5.0, heavy: 50.0}, "b": {beside: 0.0}}
    assert revised_table(table, loads, ROOTS[:3], SIDE_M, HOT_PER_S).of("b") == {light, beside}


def test_an_engine_owns_tiles_side_by_side() -> None:
    """Of twelve by twelve tiles shared by four each listens to fewer of others' than it has of its own."""
    grid, roots = Grid(SIDE_M), [Tile("hall", column, row) for column in range(12) for row in range(12)]
    table = OwnerTable()
    for _ in range(100):
        loads = {member: dict.fromkeys(table.of(member), 20.0) for member in "abcd"}
        table = revised_table(table, loads, roots, SIDE_M, HOT_PER_S)
    for member in "abcd":
        mine = table.of(member)
        assert 30 <= len(mine) <= 42
        assert len(Area(grid, mine).roots_near(31.0) - mine) < len(mine)


def test_a_tile_is_split_no_finer_than_makes_sense() -> None:
    table = settled(OwnerTable(), ["a"], {ROOTS[0]: 1e9})
    assert max(len(tile.path) for tile in table.owners) == 3


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sets(st.sampled_from("abcd"), min_size=1), st.floats(0, 1000)), min_size=1, max_size=12))
def test_every_place_has_one_owner_that_is_alive(history: list[tuple[set[str], float]]) -> None:
    table, grid = OwnerTable(), Grid(SIDE_M)
    for members, load in history:
        table = settled(table, sorted(members), dict.fromkeys(ROOTS[:2], load), 2)
        assert set(table.owners.values()) <= members
        assert table.global_engine in members
        for x_m in (0.0, 31.9, 32.0, 63.9, 130.0):
            owners = [member for member in members if FloorPoint("hall", x_m, 16.0) in Area(grid, table.of(member))]
            assert len(owners) == 1
    assert OwnerTable.of_document(table.document()) == table
