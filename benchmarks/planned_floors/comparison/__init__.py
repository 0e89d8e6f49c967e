"""The service over floors of many kinds and seeds, beside the believer of paths."""
