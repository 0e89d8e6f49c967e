"""Plans that other software has of a site, as the datums, resources and zones of a site file."""
