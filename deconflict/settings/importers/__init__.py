"""Imports plans of other software as datums, resources, zones and obstacles of a site file."""
