"""Which program stands for one of the worksheet's when that one is not there under its name.

A missing or misspelt entry point costs its own marks and no others (DESIGN section 5), so the nearest program is run in
its place. Pure; the stage that runs it and the checks that judge it ask here, so that both mean the same one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from lab2_grader import lab
from lab2_grader.near import nearest
from lab2_grader.records import Build

# What students call a talker or a listener instead: the words of the ROS 2 tutorials.
ROLES = (("talk", "publish", "pub"), ("listen", "subscri", "sub"))


def program(name: str, build: Build, broken: Collection[str] = ()) -> tuple[str, str]:
    """(`executable` or `module`, its name) to be run for the numeric *name*; two empty strings when there is nothing.

    Args:
        name: The talker's or the listener's name in the worksheet.
        build: What was installed.
        broken: Executables that cannot run although their module is there.
    """
    unusable = {*broken, *build.dangling, *(other for other in build.executables if misdirected(other, build))}
    if name in build.executables and name not in unusable:
        return "executable", name
    if name in build.modules:
        return "module", name
    executables = [found for found in build.executables if found not in unusable]
    for how, candidates in (("executable", executables), ("module", build.modules)):
        if found := _nearest(name, candidates):
            return how, found
    return "", ""


def launched(name: str, build: Build) -> str:
    """The executable that a launch file has to start for *name*: the one of that name, or what stands in for it."""
    return name if name in build.executables else _nearest(name, build.executables) or name


def misdirected(name: str, build: Build) -> str:
    """The module that the entry point *name* names although it is another program's, and its own is there; else empty."""
    specification = lab.specification()
    for point in build.entry_points:
        module = point.target.partition(":")[0].strip().removeprefix(f"{specification.package}.")
        if point.name == name and name in build.modules and module in {*specification.programs} - {name}:
            return module
    return ""


def _nearest(name: str, candidates: Iterable[str]) -> str:
    specification = lab.specification()
    taken = specification.programs
    free = sorted(set(candidates) - {*taken, "__init__"})
    if found := nearest(name, free, taken):
        return found
    words, others = ROLES if name == specification.numeric.talker else reversed(ROLES)
    of_role = [c for c in free if any(w in c.lower() for w in words) and not any(w in c.lower() for w in others)]
    return of_role[0] if len(of_role) == 1 else ""
