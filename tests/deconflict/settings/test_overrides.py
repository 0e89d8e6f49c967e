import pytest

from deconflict.settings.overrides import with_overrides
from deconflict.settings.site import DEFAULT, Conflict, Site
from deconflict.settings.site_file import SiteError


def test_a_setting_is_changed_and_the_others_stay() -> None:
    before = Site(name="Hall", conflict=Conflict(warning_s=6.0))
    after = with_overrides(before, ["conflict.clearance_m=0.4", "confirm=[3, 4]", "forget_after=120"])
    assert (after.conflict.clearance_m, after.conflict.confirm, after.reading.forget_after_s) == (0.4, (3, 4), 120.0)
    assert (after.name, after.conflict.warning_s) == ("Hall", 6.0)
    assert before.conflict.clearance_m == DEFAULT.conflict.clearance_m


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("clearence=0.4", "there is no such setting; did you mean conflict.clearance_m?"),
        ("wombat=1", "docs/site-file.md lists every key"),
        ("clearance", "expected KEY=VALUE"),
        ("clearance=wide", "is not a TOML value"),
        ("clearance=-1", "greater than or equal to 0"),
        ("critical=9.0", "expected at most conflict.warning_s"),
        ("conflict.clearence_m=0.4", "did you mean clearance_m?"),
        ("host='a'", "receiver.host or operator.host"),
    ],
)
def test_an_invalid_override_is_an_error(change: str, expected: str) -> None:
    with pytest.raises(SiteError, match=r"--set has problems:\n.*" + expected.replace("?", r"\?")):
        with_overrides(DEFAULT, [change])
