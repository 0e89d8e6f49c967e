"""The HTTP application of the operators' port."""
