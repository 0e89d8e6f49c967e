"""Compares the losses that the service finds with the true ones of simulated floors."""
