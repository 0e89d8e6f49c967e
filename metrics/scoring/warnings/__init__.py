"""How true and how complete warnings are."""
