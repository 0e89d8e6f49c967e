"""What a device stands for: a robot, a person on foot or a vehicle with a driver. The site file alone decides.

How a device moves, how large it is and what it announces decide nothing. A robot that is taken for a person loses its
warnings of people, and nothing is asked of it any more. A person who is taken for a robot has some warnings too many.
"""

from deconflict_client.participant_kinds import ParticipantKind
from ingest.settings import Vendor


def participant_of(vendor: Vendor, model: str, uuid: str) -> ParticipantKind:
    """By its UUID, else by the longest given beginning of it, else by its model, else by its vendor."""
    given = [
        (uuid == begin, len(begin), kind)
        for kind, begins in vendor.participants.items()
        for begin in map(str.lower, begins)
        if uuid == begin or (begin.endswith("*") and uuid.startswith(begin[:-1]))
    ]
    if given:
        return max(given)[-1]
    of_model = vendor.models[model].participant if model in vendor.models else None
    return of_model or vendor.participant


def has_only_people(vendor: Vendor) -> bool:
    """Whether every device of a vendor stands for a person on foot."""
    models = (model.participant for model in vendor.models.values() if model.participant)
    return {vendor.participant, *vendor.participants, *models} == {"person"}
