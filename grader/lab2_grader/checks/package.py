"""Whether the package builds and offers the executables (worksheet 6.7.4 and 6.7.5)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from lab2_grader import messages
from lab2_grader.checks import source
from lab2_grader.checks.verdicts import failed, inconclusive, passed
from lab2_grader.checks.view import SceneView, View, names
from lab2_grader.near import nearest
from lab2_grader.records import Build, EndedBy, Verdict
from lab2_grader.stand_in import misdirected

Earlier = Mapping[str, Verdict]

PLACE = re.compile(r'File "([^"]+)", line (\d+)')
READ_BY_COLCON = (
    "<unknown>"  # the text in which colcon cannot read what setup.py says: something was printed besides it
)
NOT_INITIALISED = "NotInitializedException"
ERROR_LINE = re.compile(r"^\s*((?:[A-Za-z_.]*(?:Error|Exception)|error)\b.*)$")


def package_builds(view: View, earlier: Earlier) -> Verdict:
    """The package is found and `colcon build` builds it."""
    check, build = "package-builds", view.build
    if build is None:
        fault = view.evidence.faults[0] if view.evidence.faults else messages.phrase("no-build")
        return inconclusive(check, "inconclusive-scene", fault=fault)
    if build.ok:
        return passed(check)
    if build.ended_by is EndedBy.DEADLINE:
        return failed(check, "time", seconds=round(build.seconds))
    if build.ended_by is EndedBy.LIMIT:
        return failed(check, f"limit-{build.limit}")
    if build.code == 0:
        return failed(check, "nothing-installed")
    error, file, line = _last_error(build)
    if file == READ_BY_COLCON:
        return failed(check, "prints")
    if line and error.startswith(source.UNREADABLE):
        return failed(check, "syntax", file=file, line=line, error=error)
    file, line = source.joined_entry_points(view)
    if line:
        return failed(check, "comma", file, line)
    called, file, line = source.setup_name(view)
    if line and called != view.specification.package:
        return failed(check, "name", file, line, called=called)
    return failed(check, "error", error=error)


def _last_error(build: Build) -> tuple[str, str, int]:
    """(error, file, line) of the last error of the package's own that the build printed; no file and 0 when it names none.

    That a program which colcon ran has failed is colcon's error, and follows from the package's own.
    """
    file, number, found = "", 0, ("", "", 0)
    for text in build.log.splitlines():
        if place := PLACE.search(text):
            # setuptools runs setup.py as a text without a name.
            file, number = "setup.py" if place[1] == "<string>" else place[1].rsplit("/", 1)[-1], int(place[2])
        elif (match := ERROR_LINE.match(text)) and "CalledProcessError" not in match[1]:
            found = (match[1], file, number)
    if found[0]:
        return found
    lines = [line for line in build.log.splitlines() if line.strip()]
    return (lines[-1] if lines else messages.phrase("exit-code", code=str(build.code))), "", 0


def entry_points(view: View, earlier: Earlier) -> Verdict:
    """Executables `numeric_talker` and `numeric_listener` exist; `talker` and `listener` still do."""
    check, build, specification = "entry-points", view.build, view.specification
    assert build is not None
    original, numeric = specification.original.programs, specification.numeric.programs
    missing = [name for name in specification.programs if name not in build.executables]
    found = names(build.executables)
    if missing:
        if not build.executables and build.entry_points:
            return failed(check, "dash")
        lost = [name for name in missing if name in original]
        if lost and len(lost) == len(missing):
            lines = " ".join(f"'{name} = {specification.package}.{name}:main'," for name in lost)
            return failed(check, "replaced", lines=lines, missing=names(lost), found=found)
        for name in (name for name in missing if name in numeric):
            if near := nearest(name, build.executables, specification.programs):
                file, line = source.written_in(view, "setup.py", near)
                return failed(check, "near", file, line, name=name, near=near)
        file, line = source.written_in(view, "setup.py", "console_scripts")
        return failed(check, "missing", file, line, name=missing[0], missing=names(missing), found=found)
    targets = {point.name: point.target for point in build.entry_points}
    for name in specification.programs:
        if name in build.dangling:
            return _dangling(view, build, name, targets[name])
        if module := misdirected(name, build):
            file, line = source.written_in(view, "setup.py", targets[name])
            return failed(check, "wrong-module", file, line, name=name, target=targets[name], module=module)
    for name in specification.programs:
        if name in targets and (key := _no_function(view, name, targets[name])):
            file, line = source.written_in(view, "setup.py", targets[name])
            return failed(check, key, file, line, name=name, target=targets[name])
    return passed(check)


def _dangling(view: View, build: Build, name: str, target: str) -> Verdict:
    """An entry point that names no module of the package: perhaps the file is there, in the wrong folder."""
    check, package = "entry-points", view.specification.package
    if name not in build.modules:
        paths = [source.path for source in view.evidence.submission.sources]
        misplaced = next((p for p in paths if p.endswith(f"{name}.py") and p.rsplit("/", 1)[-1] == f"{name}.py"), "")
        if misplaced and misplaced != f"{package}/{name}.py":
            return failed(check, "misplaced", name=name, target=target, where=misplaced)
    modules = names(module for module in build.modules if module != "__init__")
    file, line = source.written_in(view, "setup.py", target)
    return failed(check, "dangling", file, line, name=name, target=target, modules=modules)


def _no_function(view: View, name: str, target: str) -> str:
    """Which fault it is that *target* names no function, as the executable said when it was run; empty when it is none."""
    module, function = (part.strip() for part in target.partition(":")[::2])
    if not function:
        return "no-function"
    if any(scene.says(name, f"module '{module}' has no attribute '{function}'") for scene in view.scenes()):
        return "indented" if source.is_method(view, name, function) else "function"
    return "class" if any(_makes_a_node_at_once(scene, name, function) for scene in view.scenes()) else ""


def _makes_a_node_at_once(scene: SceneView, name: str, function: str) -> bool:
    """Whether rclpy was not initialised when *name* made its node, and neither *function* nor a module was running."""
    if not scene.says(name, NOT_INITIALISED):
        return False
    above = re.compile(rf'\.py", line \d+, in (<module>|{re.escape(function)})$')
    return not any(above.search(line.text) for line in scene.lines_of(name))
