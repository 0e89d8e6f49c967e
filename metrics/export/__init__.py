"""The ledger of lost time as files: reports, CSV and Parquet."""
