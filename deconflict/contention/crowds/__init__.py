"""Robots that report from one place, where their bodies can't all be."""
