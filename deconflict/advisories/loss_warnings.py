"""What the service had published before a loss: whether it warned of it, and whether its advice was followed.

Pure: the same revisions and losses give the same answers, live and in a replay.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from math import inf

from deconflict.foresight.losses.loss import Loss, LossKind, LossNotice
from deconflict.foresight.probability.advice_followers import waits_until_s
from deconflict_client.advisory import AdvisoryState, AnyAdvisory

FORESEEN_S = 2.0
"""An advisory warns of a loss if it named both robots for this long before the loss began."""
KEPT_S = 600.0
"""What is over is kept for this long. Losses are reported when they end, or last 60 s."""
FORGETS_EVERY_S = 60.0


def nobody_asked(*_: object) -> bool:
    """Where nothing is asked of robots, none follows."""
    return False


@dataclass(slots=True)
class _Span:
    from_s: float
    until_s: float = inf

    def holds(self, at_s: float) -> bool:
        return self.from_s <= at_s <= self.until_s


@dataclass(slots=True)
class _Published:
    """One advisory: by robot, when it named it, and when it advised it to wait."""

    named: dict[str, _Span] = field(default_factory=dict)
    advised: dict[str, _Span] = field(default_factory=dict)


class LossWarnings:
    """The advisories that are open, or were not long ago."""

    def __init__(
        self,
        advisories: Iterable[AnyAdvisory],
        last_advised_wait_s: Callable[[str], float],
        has_followed: Callable[[str, str, float], bool] = nobody_asked,
    ) -> None:
        """`advisories` are open from before; `last_advised_wait_s(uuid)` is when a robot was last seen to wait as
        advised; `has_followed(uuid, uuid, at_s)` whether one of two robots did then what it was asked for the other."""
        self._last_advised_wait_s, self._has_followed = last_advised_wait_s, has_followed
        self._published: dict[str, _Published] = defaultdict(_Published)
        """By id."""
        self._ids: dict[str, set[str]] = defaultdict(set)
        """By robot, the ids of the advisories that name it, or did."""
        self._notices: dict[str, tuple[Loss, LossNotice]] = {}
        """By losing robot, its last loss."""
        self._forgot_s = -inf
        for advisory in advisories:
            self._note(advisory)

    def note(self, now_s: float, revisions: Iterable[AnyAdvisory]) -> None:
        """Add the revisions of a pass."""
        for revision in revisions:
            self._note(revision)
        if now_s - self._forgot_s >= FORGETS_EVERY_S:
            self._forgot_s = now_s
            self._forget(now_s - KEPT_S)

    def notice_of(self, loss: Loss) -> LossNotice:
        """What was published before a loss began. A later part of a long loss has what its first part had.

        A robot that stands in a deadlock does not wait as advised: only what it was asked for the other counts.
        """
        before = self._notices.get(loss.robot)
        if before and (before[0].by, before[0].until_s) == (loss.by, loss.from_s):
            notice = before[1]
        else:
            notice = self._notice_of(loss)
        self._notices[loss.robot] = loss, notice
        if loss.kind is LossKind.DEADLOCK and notice.is_heeded:
            return notice._replace(is_heeded=self._did_as_asked(loss))
        return notice

    def _notice_of(self, loss: Loss) -> LossNotice:
        warnings = list(self._warnings(loss))
        advised = [
            (robot, span.from_s)
            for published in warnings
            for robot, span in published.advised.items()
            if robot in (loss.robot, loss.by, loss.root) and span.holds(loss.from_s)
        ]
        is_heeded = any(self._last_advised_wait_s(robot) >= from_s for robot, from_s in advised)
        has_followed = bool(warnings) and self._did_as_asked(loss)
        return LossNotice(bool(warnings), bool(advised) or has_followed, is_heeded or has_followed)

    def _did_as_asked(self, loss: Loss) -> bool:
        return any(self._has_followed(loss.robot, other, loss.from_s) for other in {loss.by, loss.root})

    def _warnings(self, loss: Loss) -> Iterator[_Published]:
        """The advisories that named both robots from long enough before the loss until it began."""
        for advisory_id in self._ids.get(loss.robot, ()):
            named = self._published[advisory_id].named
            for other in {loss.by, loss.root} & named.keys():
                spans = named[loss.robot], named[other]
                if all(span.from_s <= loss.from_s - FORESEEN_S and span.holds(loss.from_s) for span in spans):
                    yield self._published[advisory_id]
                    break

    def _note(self, revision: AnyAdvisory) -> None:
        """An advisory that is new here named its robots since it was raised."""
        now_s, is_known = revision.updated_at.timestamp(), revision.id in self._published
        from_s, published = now_s if is_known else revision.raised_at.timestamp(), self._published[revision.id]
        is_cleared = revision.state is AdvisoryState.CLEARED
        advised = () if is_cleared else waits_until_s((revision,))
        _update(published.named, () if is_cleared else revision.robots, from_s, now_s)
        _update(published.advised, advised, now_s, now_s)
        for robot in revision.robots:
            self._ids[robot].add(revision.id)

    def _forget(self, before_s: float) -> None:
        for advisory_id, published in list(self._published.items()):
            for spans in (published.named, published.advised):
                for robot in [robot for robot, span in spans.items() if span.until_s < before_s]:
                    del spans[robot]
            if not published.named:
                del self._published[advisory_id]
        ids: dict[str, set[str]] = defaultdict(set)
        for advisory_id, published in self._published.items():
            for robot in published.named:
                ids[robot].add(advisory_id)
        self._ids = ids
        self._notices = {robot: last for robot, last in self._notices.items() if last[0].until_s >= before_s}


def _update(spans: dict[str, _Span], robots: Collection[str], from_s: float, now_s: float) -> None:
    """Begin, continue and end spans by robot: those of `robots` are open from now on, and no others."""
    for robot, span in spans.items():
        if robot not in robots:
            span.until_s = min(span.until_s, now_s)
    for robot in robots:
        if robot in spans and spans[robot].until_s >= now_s:
            spans[robot].until_s = inf
        else:
            spans[robot] = _Span(from_s)
