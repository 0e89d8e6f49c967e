"""Imports plans of other software as datums, resources and zones of a site file."""
