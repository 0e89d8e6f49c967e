"""How far maps that are found from driving are from the true ones."""
