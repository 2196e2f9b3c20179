"""Worlds, learners and studies by name: ours, and those that other packages add.

A name stands for an object reference, "package.module" or "package.module:attribute", which is
imported when it is asked for and not before: listing the studies must not load JAX.  Another
package adds a name through an entry point of the registry's group, for example

    [project.entry-points."ethogram.worlds"]
    meadow = "grazing.meadow:Meadow"
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, distributions, entry_points
from typing import Any, Generic, TypeVar, cast

from ethogram.core.errors import EthogramError, UnknownName, place_of

T = TypeVar("T")


class Registry(Generic[T]):
    """The names of one kind of thing, each loaded when it is first asked for.

    A name means one thing only.  Two sources for it would make a study's records depend on the
    order in which packages were installed, so asking for it is an error and never a silent choice.
    Whatever is wrong with an entry, the others can be used.  It can be iterated, for the names, and
    indexed with one.
    """

    def __init__(
        self,
        what: str,
        group: str,
        builtin: Mapping[str, str],
        trouble_with: Callable[[str, Any], str] | None = None,
    ) -> None:
        """Begin with those that are ours.

        Args:
            what: one entry in messages ("study").
            group: the group of the entry points.
            builtin: object references by name.
            trouble_with: says what a plug-in lacks that is loaded under a name, or "".

        """
        self.what = what
        self.group = group
        self._trouble_with = trouble_with
        self._builtin = {name: EntryPoint(name, value, group) for name, value in builtin.items()}

    def __iter__(self) -> Iterator[str]:
        """All names, sorted; nothing is imported."""
        return iter(sorted(self._entries()))

    def __len__(self) -> int:
        """How many names there are."""
        return len(self._entries())

    def __contains__(self, name: object) -> bool:
        """Whether somebody registered the name; nothing is imported."""
        return isinstance(name, str) and name in self._entries()

    def __repr__(self) -> str:
        return f"<{self.what} registry: {', '.join(self)}>"

    def __getitem__(self, name: str) -> T:
        """The thing of that name.

        Raises `UnknownName` for a name that nobody registered, and `EthogramError` for one that two
        packages claim or for a plug-in that cannot be imported or is not what it has to be: with
        its package, file and line.  A failure inside Ethogram itself keeps its own traceback.
        """
        entries = self._entries()
        if not isinstance(name, str) or name not in entries:
            raise UnknownName(self.what, str(name), entries)
        entry, *others = entries[name]
        if others:
            raise EthogramError(
                f"Two packages register the {self.what} {name!r}: {_origin(entry)} and "
                f"{_origin(others[0])}. Rename or remove one of them."
            )
        return cast(T, entry.load() if name in self._builtin else self._loaded(entry))

    def _loaded(self, entry: EntryPoint) -> Any:
        """What a plug-in's entry stands for."""
        refusal = f"The {self.what} {entry.name!r} cannot be loaded from {_origin(entry)}: "
        try:
            loaded = entry.load()
            trouble = self._trouble_with(entry.name, loaded) if self._trouble_with else ""
        except KeyboardInterrupt:
            raise
        except BaseException as cause:  # whatever another package raises, the rest goes on
            place = place_of(cause, entry.module)
            raise EthogramError(f"{refusal}{type(cause).__name__}: {cause} ({place}).") from cause
        if trouble:
            file = getattr(sys.modules.get(entry.module), "__file__", None) or entry.module
            raise EthogramError(f"{refusal}{trouble} ({file}:1).")
        return loaded

    def _entries(self) -> dict[str, list[EntryPoint]]:
        """Our entries and the plug-ins' ones; more than one where packages claim the same name."""
        entries = {name: [entry] for name, entry in self._builtin.items()}
        for plugin in _plugins(self.group)[0]:
            entries.setdefault(plugin.name, []).append(plugin)
        return entries

    def unreadable(self) -> list[str]:
        """What is wrong with packages whose entry points cannot be read, a message for each."""
        return _plugins(self.group)[1]


def _plugins(group: str) -> tuple[list[EntryPoint], list[str]]:
    """The entry points of a group that can be read, and what keeps others from it."""
    try:
        return list(entry_points(group=group)), []
    except Exception:  # one package's are malformed: those of all others are good
        found: list[EntryPoint] = []
        troubles = []
        for package in distributions():
            try:
                found += [entry for entry in package.entry_points if entry.group == group]
            except Exception as error:
                reason = f"{type(error).__name__}: {error}"
                troubles.append(f"The entry points of {package.name!r} cannot be read: {reason}.")
        return found, troubles


def _origin(entry: EntryPoint) -> str:
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "ethogram"
    return f"the package {package!r} (entry point {entry.value!r})"
