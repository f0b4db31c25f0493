"""Reads the submission's source (its syntax tree) to sharpen a hint. Never decides a verdict, never runs anything."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from lab2_grader.checks.view import View

Place = tuple[str, int]  # file within the package, line from 1
NOWHERE: Place = ("", 0)
PRIVATE = re.compile(r"object has no attribute '(_[a-z]\w*)'")
HIDING = ("throttle_duration_sec", "once", "skip_first")  # arguments of the logger with which not every line is shown
UNREADABLE = ("SyntaxError", "IndentationError", "TabError")
ENTRY_POINT = re.compile(r"[\w-]+\s*=\s*[\w.]+:")  # name = package.module:function


def overwritten_publisher(view: View) -> tuple[str, str, int] | None:
    """(attribute, file, line) where an attribute that holds a publisher is given a second one; None when nowhere."""
    path, tree = _talker(view)
    seen: set[str] = set()
    for node in _walk(tree):
        if isinstance(node, ast.Assign) and _is_call_of(node.value, "create_publisher"):
            for target in node.targets:
                if isinstance(target, ast.Attribute):
                    if target.attr in seen:
                        return target.attr, path, node.lineno
                    seen.add(target.attr)
    return None


def second_increment(view: View) -> Place:
    """(file, line) of the second place where one attribute is increased; NOWHERE when there is none."""
    path, tree = _talker(view)
    seen: set[str] = set()
    for node in _walk(tree):
        if isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add) and isinstance(node.target, ast.Attribute):
            if node.target.attr in seen:
                return path, node.lineno
            seen.add(node.target.attr)
    return NOWHERE


def wrap_comparison(view: View) -> Place:
    """(file, line) of the condition that is to set the counter back; NOWHERE when there is none."""
    largest = view.specification.number_topic.largest
    path, tree = _talker(view)
    for node in _walk(tree):
        if isinstance(node, ast.If) and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int) and part.value > largest // 4
            for part in ast.walk(node.test)
        ):
            return path, node.lineno
    return NOWHERE


def early_increment(view: View) -> Place:
    """Where the counter is increased before the number is published."""
    path, tree = _talker(view)
    increments: list[int] = []
    for node in _walk(tree):
        if isinstance(node, ast.FunctionDef):
            increments = []
        elif isinstance(node, ast.AugAssign):
            increments.append(node.lineno)
        elif _is_call_of(node, "publish") and increments:
            return path, increments[0]
    return NOWHERE


def called_callback(view: View) -> Place:
    """Where create_timer is given the result of a call instead of a method; NOWHERE when it is not."""
    path, tree = _talker(view)
    for node in _walk(tree):
        if isinstance(node, ast.Call) and _is_call_of(node, "create_timer"):
            given = [*node.args[1:2], *(keyword.value for keyword in node.keywords if keyword.arg == "callback")]
            if any(isinstance(value, ast.Call) for value in given):
                return path, node.lineno
    return NOWHERE


def publisher_in_callback(view: View) -> Place:
    """Where a method other than __init__ makes a publisher; NOWHERE when none does."""
    path, tree = _talker(view)
    for function in _walk(tree):
        if isinstance(function, ast.FunctionDef) and function.name != "__init__":
            for node in _walk(function):
                if _is_call_of(node, "create_publisher"):
                    return path, node.lineno
    return NOWHERE


def unfinished_print(view: View, program: str) -> Place:
    """Where *program* prints something and no end of line after it; NOWHERE when it does not."""
    path, tree = _parsed(view, file_of(view, program))
    for node in _walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
            ends = [keyword.value for keyword in node.keywords if keyword.arg == "end"]
            if any(
                isinstance(end, ast.Constant) and isinstance(end.value, str) and "\n" not in end.value for end in ends
            ):
                return path, node.lineno
    return NOWHERE


def hidden_log(view: View, program: str, topic: str) -> tuple[str, str, int]:
    """(what hides it, file, line) where the callback of *topic* logs in a way that does not always show; else empty."""
    path, tree = _parsed(view, file_of(view, program))
    callbacks = [callback for node in _walk(tree) if (callback := _callback_of(node, topic))]
    for function in _walk(tree):
        if isinstance(function, ast.FunctionDef) and function.name in callbacks:
            for node in _walk(function):
                if isinstance(node, ast.Call) and (hides := _hides(node)):
                    return hides, path, node.lineno
    return "", *NOWHERE


def _callback_of(node: ast.AST, topic: str) -> str:
    """The name of the callback when *node* subscribes to *topic*, else empty."""
    if not isinstance(node, ast.Call) or not _is_call_of(node, "create_subscription"):
        return ""
    texts = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)]
    given = [*node.args[2:3], *(keyword.value for keyword in node.keywords if keyword.arg == "callback")]
    if not given or topic.lstrip("/") not in (text.lstrip("/") for text in texts):
        return ""
    callback = given[0]
    return (
        callback.attr if isinstance(callback, ast.Attribute) else callback.id if isinstance(callback, ast.Name) else ""
    )


def _hides(call: ast.Call) -> str:
    if isinstance(call.func, ast.Attribute) and call.func.attr == "debug":
        return ".debug(…)"
    return next((f"{keyword.arg}=…" for keyword in call.keywords if keyword.arg in HIDING), "")


def condition_of(view: View, path: str, executable: str) -> Place:
    """Where the launch file *path* gives the node of *executable* a condition; NOWHERE when it does not."""
    for node in _walk(_parsed(view, path)[1]):
        if isinstance(node, ast.Call):
            given = {keyword.arg: keyword.value for keyword in node.keywords}
            named = given.get("executable")
            if "condition" in given and isinstance(named, ast.Constant) and named.value == executable:
                return path, given["condition"].lineno
    return NOWHERE


def setup_name(view: View) -> tuple[str, str, int]:
    """(name, file, line) of the package as setup.py has it, in `package_name = …` or `setup(name=…)`; else empty."""
    path = "setup.py"
    for node in _walk(_parsed(view, path)[1]):
        values: list[ast.expr] = []
        if isinstance(node, ast.Assign) and any(
            isinstance(t, ast.Name) and t.id == "package_name" for t in node.targets
        ):
            values = [node.value]
        elif isinstance(node, ast.Call):
            values = [keyword.value for keyword in node.keywords if keyword.arg == "name"]
        for value in values:
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                return value.value, path, value.lineno
    return "", *NOWHERE


def is_of_rclpy(view: View, program: str, error: str) -> bool:
    """Whether *error* misses a private attribute that *program* does not name: one that rclpy's Node sets when it is made."""
    missed = PRIVATE.search(error)
    return missed is not None and missed[1] not in view.source(file_of(view, program))


def written(view: View, program: str, text: str) -> Place:
    """Where the string *text* stands in the file of *program*: a topic's name, with or without its slash."""
    path, tree = _parsed(view, file_of(view, program))
    for node in _walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value.lstrip("/") == text.lstrip("/")
        ):
            return path, node.lineno
    return NOWHERE


def written_in(view: View, path: str, text: str) -> Place:
    """Where *text* stands in one of the strings of the file *path*."""
    for node in _walk(_parsed(view, path)[1]):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and text in node.value:
            return path, node.lineno
    return NOWHERE


def joined_entry_points(view: View) -> Place:
    """Where two entry points are one text, because the comma between them is missing; NOWHERE when they are not."""
    path = "setup.py"
    for node in _walk(_parsed(view, path)[1]):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(ENTRY_POINT.findall(node.value)) > 1:
            return path, node.lineno
    return NOWHERE


def is_method(view: View, program: str, function: str) -> bool:
    """Whether *function* stands inside a class in the file of *program*."""
    nodes = _walk(_parsed(view, file_of(view, program))[1])
    inside = (part for node in nodes if isinstance(node, ast.ClassDef) for part in node.body)
    return any(isinstance(part, ast.FunctionDef) and part.name == function for part in inside)


def file_of(view: View, program: str) -> str:
    """The file that *program* is made from, as its entry point says."""
    package, build = view.specification.package, view.build
    targets = {point.name: point.target for point in build.entry_points} if build else {}
    module = targets.get(program, "").partition(":")[0].strip() or f"{package}.{program}"
    return module.replace(".", "/") + ".py"


def _talker(view: View) -> tuple[str, ast.AST | None]:
    """The talker's file and its tree."""
    return _parsed(view, file_of(view, view.talker_name))


def _parsed(view: View, path: str) -> tuple[str, ast.AST | None]:
    """*path* and its tree; no tree when it is not there or does not parse."""
    text = view.source(path)
    try:
        return path, ast.parse(text) if text else None
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return path, None


def _walk(tree: ast.AST | None) -> Iterator[ast.stmt | ast.expr]:
    """All statements and expressions, in the order in which they stand in the file."""
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.stmt | ast.expr)] if tree else []
    return iter(sorted(nodes, key=lambda node: (node.lineno, node.col_offset)))


def _is_call_of(node: ast.AST, method: str) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == method
