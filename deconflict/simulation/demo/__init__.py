"""The demo: the service beside simulated vendors, its live table, and a site service that follows advice."""
