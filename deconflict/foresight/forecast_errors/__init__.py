"""How far robots are from their forecasts, learned by vendor and model."""
