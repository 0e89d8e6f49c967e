"""What the robots of each model state of their size, which shows in which unit the others of the model state it."""

from collections import OrderedDict, defaultdict

from ingest.sizes.stated_bodies import BodyReading, Figure

MOST_MODELS = 1024
"""Models whose size is kept, the newest ones. Senders may invent models."""
MOST_EXPLAINED = 20
"""More robots are explained by the first size that is known of their model, and by later ones when they state theirs:
a sender may state another size with each message."""
_Model = tuple[str, str]
"""Vendor and name."""


class ModelSizes:
    """The newest size of each model that needed no conversion, and the robots whose size no figure explains yet."""

    def __init__(self) -> None:
        self._sizes: OrderedDict[_Model, Figure] = OrderedDict()
        self._unexplained: defaultdict[_Model, set[str]] = defaultdict(set)
        self._model_of: dict[str, _Model] = {}
        """By UUID, of the unexplained robots."""

    def figures(self, vendor: str, model: str) -> tuple[Figure, ...]:
        """What another robot of the model states, if one is known."""
        figure = self._sizes.get((vendor, model))
        return (figure,) if figure else ()

    def note(self, uuid: str, vendor: str, model: str, reading: BodyReading) -> set[str]:
        """Keep how a robot's size was read. Returns the robots that this may explain."""
        self.forget(uuid)
        key = vendor, model
        if not model:
            return set()
        if reading.is_over_limit:
            self._unexplained[key].add(uuid)
            self._model_of[uuid] = key
        if reading.rules:
            return set()
        before, (length_m, width_m, _) = self._sizes.get(key), reading.body.envelope_m
        self._sizes[key] = Figure(length_m, width_m, "another robot of its model", "same")
        self._sizes.move_to_end(key)
        if len(self._sizes) > MOST_MODELS:
            self._sizes.popitem(last=False)
        others = self._unexplained.get(key, set())
        is_news = before is None or (before != self._sizes.get(key) and len(others) <= MOST_EXPLAINED)
        return set(others) if is_news else set()

    def forget(self, uuid: str) -> None:
        """The robot is there no longer, or states another size."""
        if key := self._model_of.pop(uuid, None):
            self._unexplained[key].discard(uuid)
            if not self._unexplained[key]:
                del self._unexplained[key]
