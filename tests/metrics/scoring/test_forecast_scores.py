import numpy as np
import pytest

from deconflict.foresight.motion_assumptions import JOINED_S
from ingest.batch import Basis, Floats, Forecasts
from metrics.scoring.forecast_scores import PARTS, ForecastScores
from metrics.scoring.length_quantiles import BINS, bins_of, quantile

KIND = ("Alder", "A7", Basis.PATH)


def said(t_s: float, here: tuple[float, float], there: tuple[float, float]) -> Forecasts:
    """A robot that is here and says that it will be there in ten seconds, heading along x."""
    (x0, y0), (x1, y1) = here, there
    return Forecasts(
        start=np.array([0, 2]),
        t_s=np.array([t_s, t_s + 10]),
        x_m=np.array([x0, x1]),
        y_m=np.array([y0, y1]),
        yaw_rad=np.zeros(2),
        floor=np.zeros(2, np.int64),
        length_m=np.ones(1),
        width_m=np.ones(1),
        bottom_m=np.zeros(1),
        top_m=np.ones(1),
    )


def driven(speed_mps: float, said_mps: float, aside_m: float = 0.0, until_s: int = 40) -> ForecastScores:
    """One that goes along x at a speed, and says that it goes at another and ends up aside."""
    errors = ForecastScores()
    for second in range(until_s):
        x_m = speed_mps * second
        errors.add(["a"], [KIND], said(float(second), (x_m, 0.0), (x_m + 10 * said_mps, aside_m)))
        errors.advance(float(second))
    errors.finish()
    return errors


def row(errors: ForecastScores, horizon: int) -> dict[str, float]:
    return errors.figures()["by_model"][0]["horizons"][horizon - 1]


def test_a_forecast_that_comes_true_has_no_error() -> None:
    numbers = row(driven(1.0, 1.0), 10)
    # those of the first 30 of 40, after which nobody knows what became of them
    assert (numbers["cases"], numbers["distance_median_m"], numbers["distance_p90_m"]) == (30, 0.0, 0.0)


def test_a_slower_robot_is_off_along_its_track_and_a_stray_one_across() -> None:
    slower, stray = row(driven(0.8, 1.0), 5), row(driven(1.0, 1.0, aside_m=2.0), 5)
    assert [slower["along_median_m"], slower["across_median_m"]] == pytest.approx([1.0, 0.0], rel=0.02)
    assert [stray["along_median_m"], stray["across_median_m"]] == pytest.approx([0.0, 1.0], rel=0.02)
    assert slower["distance_median_m"] == slower["along_median_m"]


def test_a_vendor_is_told_of_with_all_its_models() -> None:
    errors = ForecastScores()
    for second in range(40):
        for name, model, ahead_m in (("a", "Fast", 12.0), ("b", "Slow", 8.0), ("c", "Slow", 10.0)):
            errors.add(
                [name], [("Alder", model, Basis.PATH)], said(float(second), (second, 0.0), (second + ahead_m, 0.0))
            )
    errors.finish()
    (alder,) = errors.figures()["by_vendor"]
    document = alder["horizons"][9]
    assert (alder["vendor"], document["cases"]) == ("Alder", 3 * 30)
    assert [document["distance_median_m"], document["distance_p90_m"]] == pytest.approx([2.0, 2.0], rel=0.02)


def test_errors_are_told_apart_by_what_forecasts_are_made_from() -> None:
    """What is usual of a maker counts all its forecasts."""
    errors, by_order = ForecastScores(), ("Alder", "A7", Basis.ORDER)
    for second in map(float, range(80)):
        kind, aside_m = (by_order, 2.0) if second % 2 else (KIND, 0.0)
        errors.add(["a"], [kind], said(second, (second, 0.0), (second + 10, aside_m)))
    errors.finish()
    path, order = errors.figures()["by_basis"]
    assert (path["basis"], order["basis"]) == ("path", "order")
    assert [row["horizons"][4]["cases"] for row in (path, order)] == [38, 37]
    assert [row["horizons"][4]["across_median_m"] for row in (path, order)] == pytest.approx([0.0, 1.0], rel=0.02)
    assert len(errors.figures()["by_model"]) == 1
    assert len({tuple(row) for row in errors.usually_aside_m([KIND, by_order, ("Alder", "A7", Basis.VELOCITY)])}) == 1


def test_it_makes_no_difference_how_long_a_log_is_held() -> None:
    at_once = ForecastScores()
    for second in range(40):
        at_once.add(["a"], [KIND], said(float(second), (0.8 * second, 0.0), (0.8 * second + 10, 0.0)))
    at_once.finish()
    assert at_once.figures() == driven(0.8, 1.0).figures()


def test_what_nobody_saw_is_not_counted() -> None:
    errors = ForecastScores()
    for t_s in (0.0, 1.0, 30.0, 31.0):
        errors.add(["a"], [KIND], said(t_s, (t_s, 0.0), (t_s + 10, 0.0)))
    errors.finish()
    # at 0 and 30 s one second ahead is known; of the others nothing is
    assert [figure["cases"] for figure in errors.figures()["all"]] == [2] + [0] * 9


def test_quantiles_are_those_of_the_lengths_to_two_percent() -> None:
    lengths: Floats = np.random.default_rng(1).lognormal(0.0, 1.5, 5000)
    counts = np.bincount(bins_of(lengths), minlength=BINS)
    for share in (0.1, 0.5, 0.9):
        assert quantile(counts, share) == pytest.approx(np.quantile(lengths, share), rel=0.02)
    assert quantile(np.zeros(BINS, np.int64), 0.5) is None


def test_bands_cover_the_share_of_errors_within_them() -> None:
    errors = ForecastScores()
    for second in range(40):
        # off by 0.2 m for each second ahead; every other forecast comes with bands that are too narrow
        bands = np.full((1, 10, 3), 5.0 if second % 2 else 0.1)
        bands[0, :, 2] = 5.0
        errors.add(["a"], [KIND], said(float(second), (0.8 * second, 0.0), (0.8 * second + 10, 0.0)), bands)
    errors.finish()
    numbers = row(errors, 5)
    assert [numbers["banded"], numbers["covered_50"], numbers["covered_90"]] == pytest.approx([35, 17 / 35, 1.0])
    assert row(driven(1.0, 1.0), 5)["covered_90"] is None


def wandering(rng: np.random.Generator, t_s: float) -> Forecasts:
    """A robot that says that it will be anywhere, on either of two floors."""
    t = t_s + np.array([0.0, *np.sort(rng.choice(np.arange(1, 24), 3, replace=False) / 2)])
    x, y, yaw = rng.normal(size=(3, 4))
    ones = np.ones(1)
    return Forecasts(np.array([0, 4]), t, x, y, yaw, rng.choice(2, 4, p=(0.8, 0.2)), ones, ones, 0 * ones, ones)


def errors_by_hand(of: Forecasts, horizon_s: float, reports: list[Forecasts]) -> tuple[float, float, float] | None:
    at_s = of.t_s[0] + horizon_s
    before = max((report for report in reports if report.t_s[0] <= at_s), key=lambda forecasts: forecasts.t_s[0])
    after = min(
        (report for report in reports if report.t_s[0] > at_s), key=lambda forecasts: forecasts.t_s[0], default=before
    )
    gap_s = after.t_s[0] - before.t_s[0]
    if 0 < gap_s <= JOINED_S:
        share = (at_s - before.t_s[0]) / gap_s
        is_known = after.floor[0] == before.floor[0]
    else:
        share, is_known = 0.0, before.t_s[0] == at_s
    knot = np.searchsorted(of.t_s, at_s, side="right") - 1
    if not is_known or of.floor[knot] != before.floor[0]:
        return None
    result = [column[knot] for column in (of.x_m, of.y_m)]
    if knot + 1 < 4 and of.floor[knot + 1] == of.floor[knot]:
        result = [np.interp(at_s, of.t_s, column) for column in (of.x_m, of.y_m)]
    found = [b + share * (a - b) for a, b in ((after.x_m[0], before.x_m[0]), (after.y_m[0], before.y_m[0]))]
    off = complex(found[0] - result[0], found[1] - result[1]) * np.exp(-1j * of.yaw_rad[knot])
    return abs(off), abs(off.real), abs(off.imag)


def test_errors_are_those_of_every_forecast_held_against_every_report_by_hand() -> None:
    rng, errors = np.random.default_rng(1), ForecastScores()
    reports: dict[str, list[Forecasts]] = {}
    for second in np.arange(0, 60, 0.5):
        for robot in ("a", "b", "c"):
            if rng.random() < 0.6:
                reports.setdefault(robot, []).append(wandering(rng, second))
                errors.add([robot], [("Alder", robot, Basis.PATH)], reports[robot][-1])
        errors.advance(second)
    errors.finish()
    figures = errors.figures()
    for horizon in range(10):
        by_hand = [errors_by_hand(each, horizon + 1.0, of) for of in reports.values() for each in of]
        known = np.array([each for each in by_hand if each])
        document = figures["all"][horizon]
        assert (
            document["cases"]
            == len(known)
            == sum(figure["horizons"][horizon]["cases"] for figure in figures["by_model"])
        )
        for kind, lengths in zip(PARTS, known.T, strict=True):
            counts = np.bincount(bins_of(lengths), minlength=BINS)
            assert document[f"{kind}_median_m"] == pytest.approx(quantile(counts, 0.5), rel=0.03)
            assert document[f"{kind}_p90_m"] == pytest.approx(quantile(counts, 0.9), rel=0.03)


def test_robots_that_name_ever_new_models_take_no_more_room() -> None:
    errors = ForecastScores(most_kinds=2)
    for second in range(40):
        kind = ("Alder", f"A{second}", Basis.PATH)
        errors.add(["a"], [kind], said(float(second), (float(second), 0.0), (second + 10.0, 0.0)))
        errors.advance(float(second))
    errors.finish()
    rows = [(row["model"], row["horizons"][0]["cases"]) for row in errors.figures()["by_model"]]
    assert rows == [("", 37), ("A0", 1), ("A1", 1)]
