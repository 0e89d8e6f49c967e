"""The division of floors into tiles, the owners of the tiles, and the channels of their robots."""
