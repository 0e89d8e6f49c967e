"""The ledger of lost time."""
