"""The examples in the API's description: one for every operation that answers with JSON, true to its schema."""

from typing import Any

import jsonschema_rs

from server.app import create_app

# Nothing is recorded of what needs a folder of the server's machine, a mesh, or somebody who looks at the scene.
_WITHOUT = {"captures_get_folder", "captures_watch_folder", "clouds_put_reference"}


def test_every_operation_that_answers_with_json_has_an_example() -> None:
    document = create_app().openapi()
    found: dict[str, Any] = {}
    missing: set[str] = set()
    for path, operations in document["paths"].items():
        for operation in operations.values():
            content = {
                k: v for s, a in operation["responses"].items() if s < "3" for k, v in a.get("content", {}).items()
            }
            answer = content.get("application/json")
            if answer is None or not path.startswith("/api/"):
                continue
            if "example" in answer:
                found[operation["operationId"]] = answer
            else:
                missing.add(operation["operationId"])
    assert missing <= _WITHOUT, missing
    assert len(found) >= 30
    for name, answer in found.items():
        schema = {**answer["schema"], "components": document["components"]}
        errors = list(jsonschema_rs.Draft202012Validator(schema).iter_errors(answer["example"]))
        assert not errors, f"{name}: {errors[0].message[:300]}"
