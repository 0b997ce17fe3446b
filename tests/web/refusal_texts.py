"""Which texts of a file reach the error type: as need, got and what to do, directly or by names and helpers."""

import ast
from collections.abc import Iterator

_TOLD = {"need", "got", "to_do", "needed", "sentence"}
_ADDS = "adding"
_SKIPS = {"skip", "Skipped"}
_ASIDE = {"doubt", "moving", "refused"}
"""What is said of a pose, a tool or a frame that a robot's file leaves open."""
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def refusers(module: ast.Module) -> set[str]:
    """Return the names of a file's functions that make an error of what they are given."""
    return {one.name for one in ast.walk(module) if isinstance(one, _Function) and _refuses(one)} - {"__init__"}


def given_to_errors(module: ast.Module, refusing: frozenset[str]) -> Iterator[ast.expr]:
    """Return the constants and templates that end up in an error, by themselves or by functions that refuse.

    Names are followed to what they are assigned, and calls of the file's own functions to what these return.
    """
    functions = {one.name: one for one in ast.walk(module) if isinstance(one, _Function)}
    for scope in [module, *functions.values()]:
        flow = _Flow(scope, functions)
        for call in ast.walk(scope):
            if isinstance(call, ast.Call) and _is_error(call.func, refusing):
                for given in [*call.args[:3], *(word.value for word in call.keywords if word.arg != "where")]:
                    yield from flow.texts(given)
            elif isinstance(call, ast.Call):
                for given in _said_aside(call):
                    yield from flow.texts(given)


def _is_error(called: ast.expr, refusing: frozenset[str]) -> bool:
    match called:
        case ast.Name(id=name):
            return name.endswith("Error") or name in refusing | _SKIPS
        case ast.Attribute(attr=name):
            return name.endswith("Error") or name == _ADDS or name in refusing | _SKIPS
        case _:
            return False


def _said_aside(call: ast.Call) -> Iterator[ast.expr]:
    yield from (word.value for word in call.keywords if word.arg in _ASIDE)
    match call.func:
        case ast.Attribute(attr="append", value=ast.Attribute(attr="notes")):
            yield from call.args
        case _:
            pass


def _refuses(function: _Function) -> bool:
    """Whether it makes an error of what it is given."""
    returned = ast.unparse(function.returns) if function.returns else ""
    parameters = {one.arg for one in [*function.args.args, *function.args.kwonlyargs]}
    return returned.endswith("Error") or returned == "NoReturn" or bool(parameters & _TOLD)


class _Flow:
    """What can stand in an expression of one function."""

    def __init__(self, scope: ast.AST, functions: dict[str, _Function]) -> None:
        self._functions = functions
        self._seen: set[str] = set()
        self._assigned: dict[str, list[ast.expr]] = {}
        for node in ast.walk(scope):
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    self._assigned.setdefault(name, []).append(value)
                case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                    self._assigned.setdefault(name, []).append(value)
                case ast.NamedExpr(target=ast.Name(id=name), value=value):
                    self._assigned.setdefault(name, []).append(value)
                case _:
                    pass

    def texts(self, node: ast.expr) -> Iterator[ast.expr]:
        match node:
            case ast.Constant(value=str()):
                yield node
            case ast.JoinedStr(values=parts):
                yield node
                for part in parts:
                    if isinstance(part, ast.FormattedValue):
                        yield from self.texts(part.value)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                yield node
                for side in (left, right):
                    yield from (one for one in self.texts(side) if one is not side or isinstance(side, ast.IfExp))
            case ast.IfExp(body=first, orelse=second):
                yield from self.texts(first)
                yield from self.texts(second)
            case ast.BoolOp(values=values):
                for value in values:
                    yield from self.texts(value)
            case ast.Name(id=name) if name not in self._seen:
                self._seen.add(name)
                for value in self._assigned.get(name, []):
                    yield from self.texts(value)
            case ast.Call(func=ast.Name(id=name)) if name in self._functions and name not in self._seen:
                self._seen.add(name)
                yield from self._returned(self._functions[name])
            case _:
                pass

    def _returned(self, function: _Function) -> Iterator[ast.expr]:
        within = _Flow(function, self._functions)
        within._seen = self._seen
        for node in ast.walk(function):
            if isinstance(node, ast.Return) and node.value:
                yield from within.texts(node.value)
