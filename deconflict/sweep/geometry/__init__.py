"""Forecasts as moving rectangles: knots, poses, distances, heights and encounter classes."""
