"""The walk of docs/rest.md with what openapi-python-client generates: python walk.py ADDRESS SESSION_FOLDER.

The generated package `pyclient` stands beside the working directory and is used as it came.
"""

# pyright: basic, reportMissingImports=false

import json
import sys
from io import BytesIO
from pathlib import Path
from uuid import uuid4

from pyclient import Client
from pyclient.api.answers import answers_export_results, answers_get_answer
from pyclient.api.archives import (
    archives_get_archive,
    archives_get_report,
    archives_import_archive,
    archives_list_kept,
)
from pyclient.api.captures import captures_add, captures_change, captures_get, captures_get_file
from pyclient.api.cells import cells_get_released, cells_release
from pyclient.api.registries import registries_exports, registries_formats, registries_stages
from pyclient.api.sessions import sessions_check, sessions_create, sessions_get, sessions_guidance
from pyclient.api.solves import solves_get_result, solves_list_all, solves_solve
from pyclient.api.webhooks import webhooks_list_all, webhooks_make, webhooks_remove
from pyclient.models import (
    ArchiveUpload,
    CaptureChanges,
    CaptureUpload,
    JobStatus,
    Problem,
    ReleaseRequest,
    SessionRequest,
    WebhookRequest,
)
from pyclient.types import File


def walk(client: Client, folder: Path) -> None:
    """Go through a calibration; assert what each answer holds."""
    record = json.loads((folder / "session.json").read_text())
    captures = record.pop("captures")
    made = sessions_create.sync_detailed(
        client=client, body=SessionRequest.from_dict(record), idempotency_key=str(uuid4())
    )
    assert made.status_code == 201, made.content
    session = made.parsed.id
    assert made.headers["Location"].endswith(session)
    assert made.headers["ETag"]
    for capture in captures:
        files = [File(BytesIO((folder / name).read_bytes()), Path(name).name) for name in capture["files"]]
        body = CaptureUpload(record=json.dumps(capture), files=files)
        added = captures_add.sync_detailed(session, client=client, body=body)
        assert added.status_code == 201, added.content
        assert added.parsed.measured.verdict.value in ("pass", "warn")
    first = captures[0]
    got = captures_get.sync_detailed(session, first["id"], client=client)
    unchanged = captures_get.sync_detailed(
        session, first["id"], client=client.with_headers({"If-None-Match": got.headers["ETag"]})
    )
    assert (unchanged.status_code, unchanged.parsed) == (304, None)
    client = client.with_headers({"If-None-Match": '"none"'})
    changes = CaptureChanges.from_dict({"source": "walk"})
    late = captures_change.sync(session, first["id"], client=client, body=changes, if_match='"999"')
    assert isinstance(late, Problem)
    assert (late.status, bool(late.to_do)) == (412, True)
    right = captures_change.sync(session, first["id"], client=client, body=changes, if_match=got.headers["ETag"])
    assert right.source == "walk"
    name = Path(first["files"][0]).name
    file = captures_get_file.sync(session, first["id"], name, client=client)
    assert file.payload.read() == (folder / first["files"][0]).read_bytes()
    assert sessions_guidance.sync(session, client=client).steps
    assert sessions_check.sync(session, client=client).items is not None
    job = solves_solve.sync(session, "tcp", client=client, wait=60.0)
    assert job.status == JobStatus.DONE, job
    assert solves_get_result.sync(session, "tcp", client=client).verdict.value == "pass"
    answer = answers_get_answer.sync_detailed(session, client=client)
    assert (answer.parsed.stale, answer.headers["Scancell-Stale"]) == (False, "false")
    for export in ("json", "kuka", "abb"):
        assert len(answers_export_results.sync(session, export, client=client).payload.read()) > 100
    assert b"<html" in archives_get_report.sync(session, client=client).payload.read()
    archive = archives_get_archive.sync(session, client=client, scene=False).payload
    imported = archives_import_archive.sync(client=client, body=ArchiveUpload(file=File(archive, "cell.zip")))
    assert sessions_get.sync(imported.id, client=client).name == record["name"]
    assert archives_list_kept.sync(imported.id, client=client).items
    released = cells_release.sync(session, client=client, body=ReleaseRequest(why="walk"))
    assert cells_get_released.sync(released.cell, client=client).inputs_sha256 is not None
    missing = sessions_get.sync_detailed("nothing", client=client)
    assert (missing.status_code, missing.parsed.type_) == (404, "urn:scancell:problem:not-found")
    jobs = solves_list_all.sync(client=client).items  # the import's replay may still run
    assert JobStatus.DONE in [one.status for one in jobs], jobs
    for listed in (registries_exports, registries_formats, registries_stages):
        assert listed.sync(client=client).items
    hook = webhooks_make.sync(client=client, body=WebhookRequest.from_dict({"url": "http://127.0.0.1:9/"}))
    assert any(item.id == hook.id for item in webhooks_list_all.sync(client=client).items)
    assert webhooks_remove.sync_detailed(hook.id, client=client).status_code == 204
    print("walked")


if __name__ == "__main__":
    walk(Client(base_url=sys.argv[1], timeout=120), Path(sys.argv[2]))
