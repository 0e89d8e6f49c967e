"""VDA 5050, versions 2.0, 2.1 and 3.0, as one of the languages."""
