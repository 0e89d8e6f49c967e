"""The site as `GET /site` returns it: what a map shows below the robots, in metres in the frame of each floor."""

from pydantic import BaseModel, Field

from deconflict_client.participant_kinds import ParticipantKind

Corners = list[tuple[float, float]]


class FloorMark(BaseModel):
    """A reference point of a floor."""

    id: str
    name: str
    x: float
    y: float


class FloorImage(BaseModel):
    """The plan of a floor."""

    image: str = Field(description="its address")
    matrix: tuple[float, float, float, float, float, float] = Field(
        description="from pixels to metres, like a canvas transform"
    )


class SiteFloor(BaseModel):
    """A floor."""

    id: str = Field(description="UUID of its datum")
    name: str
    level: int
    marks: list[FloorMark]
    plan: FloorImage | None


class SitePlace(BaseModel):
    """The outline of a resource or zone on one floor. A lift has one for each of its floors."""

    id: str
    name: str
    kind: str
    capacity: int
    floor: str = Field(description="id of the floor")
    polygon: Corners


class SiteFloorPart(BaseModel):
    """A part of a floor of which predictions know nothing."""

    name: str
    floor: str = Field(description="id of the floor")
    polygon: Corners


class SiteArea(SiteFloorPart):
    """A part of a floor with a name."""

    keep_clear: bool = Field(default=False, description="whether advice sends no robot onto it")


class SiteObstacle(SiteFloorPart):
    """A rack, a wall or a machine."""

    kind: str


class SiteVendor(BaseModel):
    """A vendor that the site file names."""

    name: str
    participant: ParticipantKind = Field(
        description="what its devices stand for, unless their UUID or model says otherwise"
    )


class SiteMap(BaseModel):
    """The floors with their marks, resources, zones and obstacles, and the settings that the page shows."""

    name: str
    floors: list[SiteFloor] = Field(description="the lowest first")
    places: list[SitePlace]
    areas: list[SiteArea]
    obstacles: list[SiteObstacle]
    clearance_m: float
    horizon_s: float
    quiet_after_s: float
    silent_after_s: float
    vendors: list[SiteVendor]
    sign_in: bool = Field(description="whether the site file names people")
