"""The client for other services of the site, which is a package of its own: `deconflict_client`."""

from deconflict_client.client import AdviceListing as AdviceListing
from deconflict_client.client import Client as Client
from deconflict_client.client import ClientError as ClientError
from deconflict_client.client import NoSuchAdvisoryError as NoSuchAdvisoryError
from deconflict_client.client import NotAllowedError as NotAllowedError
from deconflict_client.client import PositionLostError as PositionLostError
from deconflict_client.client import SituationListing as SituationListing
from deconflict_client.client import UntrustedError as UntrustedError
