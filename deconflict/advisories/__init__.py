"""The life of an advisory: raised, updated and cleared, and what each revision says.

`conflict_lifecycle` for conflicts of two robots, `finding_lifecycle` for all other kinds.
"""
