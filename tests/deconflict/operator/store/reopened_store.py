"""A store that was closed and opened again."""

from deconflict.operator.store.store import Store


def reopened(store: Store) -> Store:
    store.close()
    return Store(store.path.parent)
