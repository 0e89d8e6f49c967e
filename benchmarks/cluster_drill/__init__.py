"""A cluster of three machines from the documents' own files, of which each thing is killed under traffic."""
