"""`scancell schema python-client`: the operations of `scancell_client`, made from the API's OpenAPI document."""

import builtins
import keyword
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

_HEAD = '''"""The operations of the workbench's API, made by `scancell schema python-client`, not to be edited."""

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from .connection import Connection


class Operations(Connection):
    """Each operation as a method that returns the answer's data: JSON, or bytes where it is a file."""
'''
_TAIL = """

def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _text(name: str, value: Any) -> list[tuple[str, Any]]:
    return [(name, (None, value if isinstance(value, str) else json.dumps(value)))]


def _files(name: str, files: Mapping[str, bytes]) -> list[tuple[str, Any]]:
    return [(name, (file, content)) for file, content in files.items()]
"""
_WHOLE = "Without `limit` and `cursor` it is all of them, else a page."
_TYPES = {"string": "str", "integer": "int", "number": "float", "boolean": "bool"}


def client_source() -> str:
    """Return the source of the client."""
    from server.app import create_app

    document = create_app().openapi()
    methods = [
        _method(verb.upper(), path, operation, document["components"]["schemas"])
        for path, operations in document["paths"].items()
        for verb, operation in operations.items()
        if path.startswith("/api/") and "text/event-stream" not in _answers(operation)
    ]
    return _HEAD + "".join(methods) + _TAIL


def _method(verb: str, path: str, operation: Mapping[str, Any], schemas: Mapping[str, Any]) -> str:
    """Return an operation as a method: path parameters first, then the body, the others by keyword."""
    parameters: list[Mapping[str, Any]] = operation.get("parameters", [])
    in_path = [p for p in parameters if p["in"] == "path"]
    in_query = [p for p in parameters if p["in"] == "query"]
    body: dict[str, Any] = operation.get("requestBody", {}).get("content", {})
    kind = operation.get("x-raw-body") or next(iter(body), None)
    form = _form(body["multipart/form-data"]["schema"], schemas) if kind == "multipart/form-data" else {}
    if_match = any(p["name"].lower() == "if-match" for p in parameters)
    arguments = ["self", *[f"{_name(p)}: {_type(p)}" for p in in_path], *_body_arguments(kind, form)]
    by_keyword = [f"{_name(p)}: {_type(p)} | None = None" for p in in_query if not p.get("required")]
    by_keyword += ["if_match: str | None = None"] if if_match else []
    required = [f"{_name(p)}: {_type(p)}" for p in in_query if p.get("required")]
    if required or by_keyword:
        arguments += ["*", *required, *by_keyword]
    given = [*_given(kind, form)]
    if in_query:
        pairs = ", ".join(f'"{p["name"]}": {_name(p)}' for p in in_query)
        given.append(f"params=_given({{{pairs}}})")
    headers = ['"If-Match": if_match'] if if_match else []
    if kind is not None and not form and kind != "application/json":
        headers.append(f'"Content-Type": "{kind}"')
    given += [f"headers={{{', '.join(headers)}}}"] if headers else []
    for parameter in in_path:
        kept = "'/'" if parameter["name"] == "name" else "''"
        path = path.replace(f"{{{parameter['name']}}}", f"{{quote({_name(parameter)}, safe={kept})}}")
    target = f'f"{path}"'.replace("quote(place", "quote(str(place)").replace("quote(number", "quote(str(number)")
    call = ", ".join([f'"{verb}"', target if "{" in path else f'"{path}"', *given])
    head = f"    def {operation['operationId']}({', '.join(arguments)}) -> Any:"
    is_whole = operation["operationId"].endswith("list_all") and any(p["name"] == "cursor" for p in in_query)
    more = f" {_WHOLE}" if is_whole else ""
    return f"\n{head}\n{_doc(operation, more)}        return self.{'whole' if is_whole else 'request'}({call})\n"


def _answers(operation: Mapping[str, Any]) -> list[str]:
    return [kind for answer in operation["responses"].values() for kind in answer.get("content", {})]


def _form(schema: Mapping[str, Any], schemas: Mapping[str, Any]) -> dict[str, bool]:
    """Return the names of a form's parts, and which of them are files."""
    if "$ref" in schema:
        schema = schemas[schema["$ref"].rsplit("/", 1)[1]]
    return {
        name: "contentMediaType" in str(part) or "binary" in str(part)
        for name, part in schema["properties"].items()
    }


def _body_arguments(kind: str | None, form: Mapping[str, bool]) -> Iterator[str]:
    if form:
        yield from (f"{name}: {'Mapping[str, bytes]' if is_file else 'Any'}" for name, is_file in form.items())
    elif kind == "application/json":
        yield "body: Mapping[str, Any]"
    elif kind is not None:
        yield "content: Any"


def _given(kind: str | None, form: Mapping[str, bool]) -> Iterator[str]:
    if form:
        parts = ", ".join(f'*{"_files" if is_file else "_text"}("{n}", {n})' for n, is_file in form.items())
        yield f"files=[{parts}]"
    elif kind == "application/json":
        yield "json=body"
    elif kind is not None:
        yield "content=content"


def _name(parameter: Mapping[str, Any]) -> str:
    name = parameter["name"].replace("-", "_").lower()
    return f"{name}_" if keyword.iskeyword(name) or hasattr(builtins, name) else name


def _type(parameter: Mapping[str, Any]) -> str:
    schema = parameter.get("schema", {})
    kinds = [part.get("type") for part in schema.get("anyOf", [schema])]
    return next((_TYPES[kind] for kind in kinds if kind in _TYPES), "str")


def _doc(operation: Mapping[str, Any], more: str) -> str:
    said = operation.get("description") or operation.get("summary", "")
    lines = textwrap.wrap(f'"""{" ".join(said.split())}{more}"""', 100, break_long_words=False)
    return "".join(f"        {line}\n" for line in lines)
