"""Robots of one vendor that report from one place, where their bodies can't all be."""
