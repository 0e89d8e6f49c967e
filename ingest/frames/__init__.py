"""Datums, vendor maps and floors: from the frame of a vendor to the frame of the site."""
