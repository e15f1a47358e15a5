"""Registry: a table of entries by name, for planners, cost terms, robots and export formats."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from nerfnav.core.errors import NameTakenError, UnknownNameError


@runtime_checkable
class Named(Protocol):
    """Anything with a name."""

    @property
    def name(self) -> str:
        """Name of the entry."""
        ...


Entry = TypeVar("Entry", bound=Named)


class Registry(Mapping[str, Entry], Generic[Entry]):
    """Name to entry, in the order in which they were added; users may add to it."""

    def __init__(self, kind: str, entries: Iterable[Entry] = ()) -> None:
        """A table of entries of one kind, whose word is used in errors: "planner", "robot"."""
        self.kind = kind
        self._entries: dict[str, Entry] = {}
        for entry in entries:
            self.register(entry)

    def register(self, entry: Entry) -> None:
        """Add an entry under its own name. Raises NameTakenError where another one has it."""
        if self._entries.get(entry.name, entry) is not entry:
            raise NameTakenError(self.kind, entry.name)
        self._entries[entry.name] = entry

    def unregister(self, name: str) -> None:
        """Take an entry out again. Raises UnknownNameError where there is none of that name."""
        del self._entries[self[name].name]

    def __getitem__(self, name: str) -> Entry:
        """The entry of that name. Raises UnknownNameError, which lists the known ones."""
        if name not in self._entries:
            raise UnknownNameError(self.kind, name, self._entries)
        return self._entries[name]

    def get(self, name: str, default: Any = None) -> Any:
        """The entry of that name, or `default`."""
        return self._entries.get(name, default)

    def __contains__(self, name: object) -> bool:
        """Check that there is an entry of that name."""
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        """Iterate over all names."""
        return iter(self._entries)

    def __len__(self) -> int:
        """Number of entries."""
        return len(self._entries)
