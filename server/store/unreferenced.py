"""Files that nothing refers to any more, once a capture, a session or a result has gone."""

from sqlalchemy import select

from server.store.database import Store
from server.store.models import FileRow, OutputRow


def remove_unreferenced(store: Store, digests: set[str]) -> None:
    """Remove those files, by their SHA-256, that no capture and no output of any session refers to."""
    referred = (select(column).where(column.in_(digests)) for column in (FileRow.sha256, OutputRow.sha256))
    with store.read() as db:
        unreferenced = digests.difference(*(db.scalars(query) for query in referred))
    store.blobs.remove(unreferenced)
