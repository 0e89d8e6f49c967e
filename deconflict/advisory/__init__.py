"""The published models under the name that programs of earlier releases import."""

from deconflict_client.advisory import *  # noqa: F403
