"""Plant models of openTCS."""
