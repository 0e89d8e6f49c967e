from math import nan, pi
from random import Random

from ingest.fast_path.path_kernels import placed
from ingest.frames.transforms import Adjusted, Transform
from tests.ingest.frames import made_maps

MAPS: tuple[Transform, ...] = (
    made_maps.similarity(0.7, 0.98, (12.0, -3.0), mirrored=True),
    made_maps.sheared(-2.0, 1.1, 0.9, 0.1),
    Adjusted(made_maps.similarity(0.3, 1.0, (1.0, 2.0)), made_maps.HALL, made_maps.jolts(6, 0.5, 1)),
)


def test_a_pose_is_placed_as_the_vendors_map_places_it() -> None:
    random = Random(6)
    for transform in MAPS:
        for _ in range(2000):
            pose = random.uniform(-20, 60), random.uniform(-20, 60), random.choice((nan, random.uniform(-pi, pi)))
            assert repr(placed(*pose, transform.table)) == repr(transform.pose(*pose))
