"""A recorded log through the live engine, and its scores."""
