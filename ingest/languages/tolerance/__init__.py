"""How values are read that have another type, spelling or key than the standard says. One rule for all languages."""
