"""Situations as published, under the name that programs of earlier releases import."""

from deconflict_client.situations import *  # noqa: F403
