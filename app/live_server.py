"""The newest of what comes, for whoever is slower than that."""

import asyncio
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Newest(Generic[Item]):
    """Holds one item: the newest that was not taken. Used from one event loop."""

    def __init__(self) -> None:
        """Nothing has come yet."""
        self._item: Item | None = None
        self._there = asyncio.Event()
        self._dropped = 0

    def put(self, item: Item) -> None:
        """This is newer than what is held."""
        self._dropped += self._item is not None
        self._item = item
        self._there.set()

    async def take(self) -> tuple[Item, int]:
        """Wait for an item; and how many were dropped for newer ones since the last one was taken."""
        await self._there.wait()
        assert self._item is not None, "it is there"
        item, dropped = self._item, self._dropped
        self._item, self._dropped = None, 0
        self._there.clear()
        return item, dropped
