"""The list of exports: those of no brand, those that other packages bring, and every brand's."""

from collections.abc import Iterator

from calib_core.errors import InputError
from calib_core.exports.entry import Export
from calib_core.messages import message
from calib_core.poses.conventions import WRITERS
from calib_core.registry import Registry

EXPORTS = Registry("an export", "calib_core.exports", "EXPORT", Export, "scancell.exports")


def all_exports() -> Iterator[Export]:
    """Yield every export, those of no brand first."""
    yield from EXPORTS
    for brand in WRITERS:
        yield from brand.exports()


def export_named(name: str, others: tuple[str, ...] = ()) -> Export:
    """Return an export by its name.

    Raises
    ------
    InputError
        That lists the names, with the `others`, those of the merged cloud; or says where these are.
    """
    found = next((export for export in all_exports() if export.name == name), None)
    if found is None and name in others:
        to_do = message(
            "Merge, and take it from clouds/merged.ply or clouds/mesh.ply with format={name}.", name=name
        )
        raise InputError(
            "an export of tool and table", "'{name}', of the merged cloud", to_do, "format", name=name
        )
    if found is None:
        raise InputError.unknown(name, [*(export.name for export in all_exports()), *others], "format")
    return found
