"""The examples in the API's description: one for everything that is sent and answered, true to its schema."""

from collections.abc import Iterator
from typing import Any

import jsonschema_rs
import pytest

from calib_core.steps import stage_names
from server.app import create_app


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return create_app().openapi()


def operations(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for of_path in document["paths"].values():
        yield from of_path.values()


def resolved(schema: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def examples_of(part: dict[str, Any], document: dict[str, Any]) -> list[Any]:
    """Return the examples of a body or a parameter: its own, else its schema's, else its fields'."""
    if "example" in part:
        return [part["example"]]
    if "examples" in part:
        return [example["value"] for example in part["examples"].values()]
    schema = resolved(part["schema"], document)
    if "examples" in schema:
        return schema["examples"]
    return schema_examples(schema, document)


def schema_examples(schema: dict[str, Any], document: dict[str, Any]) -> list[Any]:
    fields = schema.get("properties", {})
    needed = set(schema.get("required", ()))
    given = {name: field["examples"][0] for name, field in fields.items() if "examples" in field}
    return [given] if given and needed <= set(given) else []


def errors(example: Any, schema: dict[str, Any], document: dict[str, Any]) -> list[str]:
    whole = {**schema, "components": document["components"]}
    return [error.message[:300] for error in jsonschema_rs.Draft202012Validator(whole).iter_errors(example)]


@pytest.mark.thorough
def test_no_schema_is_named_like_what_makes_another_in_go(document: dict[str, Any]) -> None:
    """A generated Go client has a function `NewName` for every schema `Name`."""
    names = set(document["components"]["schemas"])
    assert not {name for name in names if name.removeprefix("New") in names - {name}}


@pytest.mark.thorough
def test_every_json_answer_has_an_example(document: dict[str, Any]) -> None:
    found = 0
    for operation in operations(document):
        for status, answer in operation["responses"].items():
            content = answer.get("content", {}).get("application/json")
            if content is None or status >= "3":
                continue
            name = operation["operationId"]
            assert "example" in content, name
            assert not errors(content["example"], content["schema"], document), name
            found += 1
    assert found >= 40


def test_whatever_is_made_says_where_it_is(document: dict[str, Any]) -> None:
    made = [
        answer for one in operations(document) for status, answer in one["responses"].items() if status == "201"
    ]
    assert len(made) >= 10
    assert all("Location" in answer["headers"] for answer in made)


@pytest.mark.thorough
def test_every_body_has_an_example(document: dict[str, Any]) -> None:
    found = 0
    for operation in operations(document):
        for kind, content in operation.get("requestBody", {}).get("content", {}).items():
            name = f"{operation['operationId']}, {kind}"
            examples = examples_of(content, document)
            assert examples, name
            for example in examples:
                assert not errors(example, content["schema"], document), name
            found += 1
    assert found >= 18


@pytest.mark.thorough
def test_every_name_in_a_path_has_an_example(document: dict[str, Any]) -> None:
    found = 0
    for operation in operations(document):
        for parameter in operation.get("parameters", []):
            if parameter["in"] != "path":
                continue
            name = f"{operation['operationId']}, {parameter['name']}"
            examples = examples_of(parameter, document)
            assert examples, name
            for example in examples:
                assert not errors(example, parameter["schema"], document), name
            found += 1
    assert found >= 60


@pytest.mark.parametrize("path", ["results", "results/{stage}", "timeline/{place}"])
def test_results_of_every_stage_are_described(document: dict[str, Any], path: str) -> None:
    operation = document["paths"][f"/api/v1/sessions/{{session_id}}/{path}"]["get"]
    schema = resolved(operation["responses"]["200"]["content"]["application/json"]["schema"], document)
    schema = schema["properties"]["results"] if path.startswith("timeline") else schema
    schema = resolved(schema.get("additionalProperties", schema), document)
    stages = set(stage_names())
    assert set(schema["discriminator"]["mapping"]) == stages
    for name in schema["discriminator"]["mapping"].values():
        assert {"stale", "at_workpiece", "verdict"} <= set(resolved({"$ref": name}, document)["properties"])
