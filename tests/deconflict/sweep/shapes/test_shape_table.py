"""Numbers of shapes."""

from deconflict.sweep.shapes.shape_table import ShapeTable
from ingest.shapes import Shape

SMALL, LARGE = Shape.circle(0.5), Shape.circle(2.0)


def test_a_table_numbers_shapes_as_another_one_did() -> None:
    table, other = ShapeTable(), ShapeTable()
    table.number_as([SMALL, LARGE])
    other.number_as([LARGE])
    assert other.half_m[1].tolist() == [1.0, 1.0]
    other.number_as(table.numbered)
    assert (other[1], other[2]) == (SMALL, LARGE)
    assert other.half_m.tolist() == table.half_m.tolist() == [[0.0, 0.0], [0.25, 0.25], [1.0, 1.0]]
