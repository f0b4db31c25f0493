"""Reads the submission's source (its syntax tree) to sharpen a hint. Never decides a verdict, never runs anything."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from lab2_grader.checks.view import View


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


def second_increment(view: View) -> tuple[str, int]:
    """(file, line) of the second place where one attribute is increased; ("", 0) when there is none."""
    path, tree = _talker(view)
    seen: set[str] = set()
    for node in _walk(tree):
        if isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add) and isinstance(node.target, ast.Attribute):
            if node.target.attr in seen:
                return path, node.lineno
            seen.add(node.target.attr)
    return "", 0


def wrap_comparison(view: View) -> tuple[str, int]:
    """(file, line) of the condition that is to set the counter back; ("", 0) when there is none."""
    largest = view.specification.number_topic.largest
    path, tree = _talker(view)
    for node in _walk(tree):
        if isinstance(node, ast.If) and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int) and part.value > largest // 4
            for part in ast.walk(node.test)
        ):
            return path, node.lineno
    return "", 0


def _talker(view: View) -> tuple[str, ast.AST | None]:
    """The talker's file and its tree; no tree when it is not there or does not parse."""
    package = view.specification.package
    path = f"{package}/{view.talker_name}.py"
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
