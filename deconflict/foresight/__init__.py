"""How reliable forecasts are: their errors so far, the presence of robots, and the probability that pairs meet."""
