"""Advice on who goes first: hears reports, returns requests to robots."""

from deconflict.adviser.adviser import Adviser
from deconflict.adviser.asked import Request

__all__ = ["Adviser", "Request"]
