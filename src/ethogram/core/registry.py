"""Worlds, learners and studies by name: ours, and those that other packages add.

A name stands for an object reference, "package.module" or "package.module:attribute", which is
imported when it is asked for and not before: listing the studies must not load JAX.  Another
package adds a name through an entry point of the registry's group, for example

    [project.entry-points."ethogram.worlds"]
    meadow = "grazing.meadow:Meadow"
"""

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar, cast

from ethogram.core.errors import EthogramError, UnknownName

T = TypeVar("T")


class Registry(Generic[T]):
    """The names of one kind of thing, each loaded when it is first asked for.

    A name means one thing only.  Two sources for it would make a study's records depend on the
    order in which packages were installed, so that is an error and never a silent choice.
    """

    def __init__(self, what: str, group: str, builtin: Mapping[str, str]) -> None:
        """`what` names one entry in messages ("study"), `group` is the entry points' group."""
        self.what = what
        self.group = group
        self._builtin = {name: EntryPoint(name, value, group) for name, value in builtin.items()}

    def names(self) -> list[str]:
        """All names, sorted; nothing is imported."""
        return sorted(self._entries())

    def get(self, name: str) -> T:
        """The thing of that name.

        Raises `UnknownName` for a name that nobody registered, and `EthogramError` for a plug-in
        that cannot be imported.  A failure inside Ethogram itself keeps its own traceback.
        """
        entries = self._entries()
        if name not in entries:
            raise UnknownName(self.what, name, entries)
        entry = entries[name]
        if name in self._builtin:
            return cast(T, entry.load())
        try:
            return cast(T, entry.load())
        except Exception as cause:
            raise EthogramError(
                f"The {self.what} {name!r} cannot be loaded from {_origin(entry)}: "
                f"{type(cause).__name__}: {cause}"
            ) from cause

    def _entries(self) -> dict[str, EntryPoint]:
        """Our entries and the plug-ins' ones, which may claim no name twice."""
        entries = dict(self._builtin)
        for plugin in entry_points(group=self.group):
            taken = entries.setdefault(plugin.name, plugin)
            if taken is not plugin:
                raise EthogramError(
                    f"Two packages register the {self.what} {plugin.name!r}: "
                    f"{_origin(taken)} and {_origin(plugin)}. Rename or remove one of them."
                )
        return entries


def _origin(entry: EntryPoint) -> str:
    package = entry.dist.name if entry.dist is not None else "ethogram"
    return f"the package {package!r} (entry point {entry.value!r})"
