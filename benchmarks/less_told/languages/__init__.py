"""The messages of the driven robots in each language, with a given set of optional fields."""
