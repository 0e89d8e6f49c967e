"""Why advisories and situations are cleared: a code for programs, and its sentence for people."""

from enum import StrEnum
from typing import Self


class ClearedCode(StrEnum):
    """Why an advisory or a situation was cleared."""

    because: str
    """The same for people. A robot's `name` leads, `by` is another robot."""

    def __new__(cls, code: str, because: str) -> Self:
        member = str.__new__(cls, code)
        member._value_, member.because = code, because
        return member

    PASSED = "passed", "they have passed each other"
    BOTH_STAND = "both_stand", "they stand still"
    GAVE_WAY = "gave_way", "one gave way"
    UNPREDICTED = "unpredicted", "no longer predicted"
    CROWDED = "crowded", "both report from a place with many others of their vendors"
    BOTH_SILENT = "both_silent", "both are silent, and nothing says that they move"
    LEFT = "left", "{name} left the floor"
    LEFT_IN_SILENCE = "left_in_silence", "{name} is silent and has probably left"
    OFF_FLOOR = "off_floor", "{name} is off the floor, as an operator says"
    MOVED_BY_HAND = "moved_by_hand", "{name} was moved by hand, or its localisation jumped"
    DRIVEN_THROUGH = "driven_through", "{name} is not there: {by} has driven through its place"
    NO_LONG_WAIT = "no_long_wait", "nobody is expected to wait long any more"
    WITHIN_CAPACITY = "within_capacity", "no more robots are there than it takes"
    UNLOCKED = "unlocked", "they no longer wait for each other"
    OUT_OF_THE_WAY = "out_of_the_way", "it no longer stands in anybody's way"
    NOT_CLAIMED = "not_claimed", "the other vendor no longer reports them"
    ONE_PLACE = "one_place", "they are reported from one place again"
    DISPERSED = "dispersed", "they no longer report from one place"
    NOTHING_LEFT = "nothing_left", "nothing is foreseen there any more"
    ENDS_BY_ITSELF = "ends_by_itself", "what is left of it passes by itself"
    JOINED = "joined", "it became part of another situation"
    FAULT = "fault", "situations begin anew after a fault"
    DONE = "done", "it is done"
    DECLINED = "declined", "its vendor declined it"
    LAPSED = "lapsed", "its time is over"
    WITHDRAWN = "withdrawn", "it is not needed any more, or another robot is asked"
    RESTARTED = "restarted", "the service began anew, and asks again if it is still needed"
    UNREAD = "unread", "the service could not read it when it started"
