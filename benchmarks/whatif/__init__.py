"""How right answers of `deconflict whatif` are: predicted changes beside those that are really made."""
