"""Robots that are not rectangles: their convex pieces, exact distances of these, and the decisions of FCL."""
