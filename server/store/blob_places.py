"""Where files by their SHA-256 are kept: a folder, or a bucket of an S3 store."""

from calib_core.archive.observation_store import KeptObservations
from calib_core.errors import InputError
from calib_core.messages import message
from server.settings import BlobPlace
from server.store.blobs import Blobs

_S3 = "s3://"


def open_blobs(place: BlobPlace, make: bool = True, look: bool = True) -> Blobs:
    """Return the blobs at a place; a folder that is missing is made, where that is wanted.

    `look` asks for the bucket: who knows that it is there goes without, since a store that is away at the
    moment is no wrong setting.

    Raises
    ------
    InputError
        If the place is of no known kind, or there is no such bucket.
    """
    blobs = _opened(place, make, look)
    blobs.observations = KeptObservations(place.observations)
    return blobs


def _opened(place: BlobPlace, make: bool, look: bool) -> Blobs:
    if place.bucket is None:
        from server.store.blob_folder import FolderBlobs

        return FolderBlobs(place.folder, make)
    if not place.bucket.startswith(_S3):
        to_do = message(
            "Write SCANCELL_BLOBS=s3://bucket or s3://bucket/prefix; leave it out for the data folder."
        )
        raise InputError("an S3 address", repr(place.bucket), to_do, "blobs")
    from server.store.blob_bucket import BucketBlobs

    bucket, _, prefix = place.bucket.removeprefix(_S3).partition("/")
    blobs = BucketBlobs(bucket, prefix.strip("/"), place.endpoint, place.folder, make)
    if look:
        blobs.require_bucket()
    return blobs
