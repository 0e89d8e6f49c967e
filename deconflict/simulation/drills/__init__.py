"""Scripted situations, each of which leads to one kind of advisory."""
