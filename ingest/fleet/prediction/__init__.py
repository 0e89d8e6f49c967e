"""The forecast of one robot from its status."""
