"""The life of an advisory: raised, updated and cleared, and what each revision says."""
