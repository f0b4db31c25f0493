"""Looks at the machine and the terminal and says what would get in the way: what is, what should be, what mends it.

`look_around` gathers facts and decides nothing; `examine` is a pure function of them. The sentences are in the catalogue,
under `[doctor]`; each belongs to a row of the worksheet's troubleshooting table where there is one.
"""

from __future__ import annotations

import os
import resource
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from lab2_grader import lab, messages, process, ros, sandbox
from lab2_grader.classroom.pool import memory_free
from lab2_grader.errors import Lab2Error
from lab2_grader.records import Limits, Record, Request
from lab2_grader.ros.domains import SAFE
from lab2_grader.submission import products
from lab2_grader.text import clean

NESTED_DEPTH = 3
ENOUGH_MEMORY = 1_000_000_000  # bytes
ENOUGH_DISK = 1_000_000_000  # bytes
ENOUGH_PROCESSES = 500
NAME_LENGTH = 200


class Terminal(Record, frozen=True):
    """What a process says of the ROS world that it is in; all empty where nothing is set."""

    pid: int
    name: str
    domain: str
    range: str


class Surroundings(Record, frozen=True):
    """What was found on the machine.

    Args:
        container: `Singularity`, `Docker` or another name; empty when outside one.
        distro: `ROS_DISTRO`; empty when ROS is not sourced.
        ros2: Where the program `ros2` is; empty when it is not found.
        wheels: Whether the grader has a ROS of its own.
        workspace: The students' workspace.
        workspace_there: Whether it exists.
        workspace_built: Whether the package was built in it.
        workspace_sourced: Whether this terminal was told about that.
        here: This terminal's ROS world.
        others: Those of the user's other processes that use ROS.
        daemon: The `ros2` daemon, when one runs.
        nodes: The lab's nodes that are running.
        colcon: Where `colcon` is; empty when it is not found.
        products: Folders that colcon made where they should not be.
        repositories: Git repositories, one inside the other, outermost first.
        keys: SSH keys that there are, or `agent`.
        python: Which `python3` is first.
        python_has_rclpy: Whether it can import rclpy.
        isolation: Whether submissions can be isolated.
        keeper: By what means the limits of a submission are kept, as a sentence.
        processes: How many the user may have; 0 for no limit.
        memory: Bytes that are free.
        disk: Bytes that are free where temporary files go.
    """

    container: str
    distro: str
    ros2: str
    wheels: bool
    workspace: str
    workspace_there: bool
    workspace_built: bool
    workspace_sourced: bool
    here: Terminal
    others: tuple[Terminal, ...]
    daemon: Terminal | None
    nodes: tuple[Terminal, ...]
    colcon: str
    products: tuple[str, ...]
    repositories: tuple[str, ...]
    keys: tuple[str, ...]
    python: str
    python_has_rclpy: bool
    isolation: sandbox.Isolation
    keeper: str
    processes: int
    memory: int
    disk: int


class Finding(Record, frozen=True):
    """One line of the examination; `wanted` and `mend` are empty when it is well."""

    what: str
    well: bool
    found: str
    wanted: str = ""
    mend: str = ""
    symptom: str = ""


# --- gathering ----------------------------------------------------------------------------------


def look_around(
    environment: Mapping[str, str] | None = None, folder: Path | None = None, home: Path | None = None
) -> Surroundings:
    """Gather the facts; nothing is changed and nobody is asked over the network.

    Args:
        environment: Variables of the terminal; None for this process's own.
        folder: Where the terminal is; None for this process's working folder.
        home: The user's home; None for this user's.
    """
    variables = dict(os.environ if environment is None else environment)
    folder, home = (folder or Path.cwd()).resolve(), home or Path.home()
    package = lab.specification().package
    workspace = home / lab.course().workspace.removeprefix("~/")
    installed = workspace / "install"
    prefixes = variables.get("AMENT_PREFIX_PATH", "").split(":") + variables.get("COLCON_PREFIX_PATH", "").split(":")
    path = variables.get("PATH", "")
    python = shutil.which("python3", path=path) or ""
    running = tuple(_running())
    return Surroundings(
        container=_container(variables),
        distro=variables.get("ROS_DISTRO", ""),
        ros2=shutil.which("ros2", path=path) or "",
        wheels=_has_wheels(),
        workspace=lab.course().workspace,
        workspace_there=workspace.is_dir(),
        workspace_built=(installed / package).is_dir(),
        workspace_sourced=any(entry and Path(entry).is_relative_to(installed) for entry in prefixes),
        here=_terminal(os.getpid(), "this terminal", variables),
        others=tuple(found for _, found, variables_of in running if variables_of.get("ROS_DISTRO")),
        daemon=next((found for command, found, _ in running if _is_daemon(command)), None),
        nodes=tuple(found for command, found, _ in running if f"/lib/{package}/" in command),
        colcon=shutil.which("colcon", path=path) or "",
        products=_products(folder, workspace),
        repositories=_repositories(folder),
        keys=_keys(home, variables),
        python=python,
        python_has_rclpy=bool(python) and _can_import_rclpy(python, variables),
        isolation=sandbox.probe(),
        keeper=sandbox.limits_kept_by(),
        processes=_process_limit(),
        memory=memory_free(),
        disk=shutil.disk_usage(tempfile.gettempdir()).free,
    )


def _has_wheels() -> bool:
    try:
        return bool(ros.find("wheels"))
    except Lab2Error:
        return False


def _terminal(pid: int, name: str, variables: Mapping[str, str]) -> Terminal:
    discovery = variables.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if not discovery and variables.get("ROS_LOCALHOST_ONLY", "0") == "1":
        discovery = "LOCALHOST"
    return Terminal(pid, clean(name, NAME_LENGTH), variables.get("ROS_DOMAIN_ID", ""), discovery.upper())


def _container(variables: Mapping[str, str]) -> str:
    for variable, name in (("APPTAINER_CONTAINER", "Apptainer"), ("SINGULARITY_CONTAINER", "Singularity")):
        if variables.get(variable):
            return name
    if Path("/.singularity.d").exists():
        return "Singularity"
    return "Docker" if Path("/.dockerenv").exists() or Path("/run/.containerenv").exists() else ""


def _running() -> Iterator[tuple[str, Terminal, dict[str, str]]]:
    """(command line, its terminal, its variables) of each of the user's other processes."""
    for entry in sorted(Path("/proc").iterdir()):
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            if entry.stat().st_uid != os.getuid():
                continue
            arguments = (entry / "cmdline").read_bytes().decode(errors="replace").rstrip("\0").split("\0")
            raw = (entry / "environ").read_bytes().decode(errors="replace")
        except OSError:
            continue
        variables = dict(line.split("=", 1) for line in raw.split("\0") if "=" in line)
        names = [Path(argument).name for argument in arguments[:2] if argument and not argument.startswith("-")]
        yield " ".join(arguments), _terminal(int(entry.name), names[-1] if names else entry.name, variables), variables


def _is_daemon(command: str) -> bool:
    return "_ros2_daemon" in command or "ros2cli.daemon" in command


def _products(folder: Path, workspace: Path) -> tuple[str, ...]:
    """What colcon made in *folder*, in the folders above it up to the workspace, or in the workspace's sources."""
    places = [folder]
    if folder.is_relative_to(workspace):
        places += [above for above in folder.parents if above.is_relative_to(workspace)]
    sources = workspace / "src"
    if sources.is_dir():
        places += [sources, *sorted(path for path in sources.iterdir() if path.is_dir())]
    found = [
        place / name
        for place in dict.fromkeys(places)
        if place != workspace and not (place / "src").is_dir()
        for name in sorted(products.COLCON)
        if (place / name).is_dir() and products.is_made_by_colcon(name, os.listdir(place / name))
    ]
    return tuple(clean(str(path), NAME_LENGTH) for path in found)


def _repositories(folder: Path) -> tuple[str, ...]:
    """The git repositories that *folder* is in, and those within it, outermost first."""
    around = [above for above in (folder, *folder.parents) if (above / ".git").exists()]
    within = []
    if around:
        patterns = ["*/" * depth + ".git" for depth in range(1, NESTED_DEPTH + 1)]
        within = sorted(path.parent for pattern in patterns for path in folder.glob(pattern))
    return tuple(clean(str(path), NAME_LENGTH) for path in (*reversed(around), *within))


def _keys(home: Path, variables: Mapping[str, str]) -> tuple[str, ...]:
    found = sorted(path.name for path in (home / ".ssh").glob("id_*.pub")) if (home / ".ssh").is_dir() else []
    agent = variables.get("SSH_AUTH_SOCK", "")
    return (*found, "agent") if agent and Path(agent).exists() else tuple(found)


def _can_import_rclpy(python: str, variables: Mapping[str, str]) -> bool:
    request = Request((python, "-c", "import rclpy"), tuple(variables.items()), "/", Limits(seconds=20))
    return process.run(request).code == 0


def _process_limit() -> int:
    soft, _ = resource.getrlimit(resource.RLIMIT_NPROC)
    return 0 if soft == resource.RLIM_INFINITY else soft


# --- judging ------------------------------------------------------------------------------------


def examine(found: Surroundings) -> tuple[Finding, ...]:
    """One finding a question, in the order in which a person would mend them."""
    uses_ros = bool(found.distro)
    return (
        _ros(found),
        _python(found),
        _workspace(found),
        *((_domain(found), _range(found), _terminals(found), _daemon(found)) if uses_ros else ()),
        _nodes(found),
        _finding("colcon", bool(found.colcon) or found.wheels, path=found.colcon or "beside the grader's own ROS"),
        _finding("products", not found.products, folders=", ".join(found.products), first=" ".join(found.products)),
        _repository(found),
        _finding("ssh", bool(found.keys), keys=", ".join(found.keys)),
        _finding(
            "isolation",
            found.isolation.on,
            reason=found.isolation.reason,
            command=found.isolation.mend,
            keeper=found.keeper,
        ),
        _limits(found),
    )


def _finding(key: str, well: bool, ill: str = "", **values: messages.Value) -> Finding:
    """The finding under *key*; *ill* picks between several ways to be unwell."""
    texts = messages.catalogue().doctor[key]
    if well:
        return Finding(texts.what, True, messages.fill(texts.well, **values))
    fault = texts.ill[ill or "any"]
    return Finding(
        texts.what,
        False,
        messages.fill(fault.found, **values),
        messages.fill(texts.wanted, **values),
        messages.fill(fault.mend, **values),
        fault.symptom,
    )


def _ros(found: Surroundings) -> Finding:
    wanted, place = lab.course().ros_distro, found.container or "no container"
    values = {"distro": found.distro, "wanted": wanted, "place": place}
    if not found.distro and found.wheels:
        values["distro"] = f"{wanted} (the grader's own; none is sourced)"
        return _finding("ros", True, **values)
    ill = "none" if not found.distro else "other" if found.distro != wanted else "path"
    return _finding("ros", found.distro == wanted and bool(found.ros2), ill, **values)


def _python(found: Surroundings) -> Finding:
    return _finding("python", found.python_has_rclpy or not found.distro, path=found.python or "no python3")


def _workspace(found: Surroundings) -> Finding:
    well = found.workspace_sourced or not found.workspace_there or not found.distro
    ill = "unsourced" if found.workspace_built else "unbuilt"
    state = "sourced" if found.workspace_sourced else "not in use here"
    package = lab.specification().package
    return _finding("workspace", well, ill, workspace=found.workspace, state=state, package=package)


def _domain(found: Surroundings) -> Finding:
    domain = found.here.domain or "0"
    return _finding("domain", domain.isdigit() and int(domain) in SAFE, domain=domain, largest=SAFE[-1])


def _range(found: Surroundings) -> Finding:
    alone = found.here.range in ("LOCALHOST", "OFF") or found.here.domain not in ("", "0")
    return _finding("range", alone, range=found.here.range or "SUBNET", domain=found.here.domain or "0")


def _terminals(found: Surroundings) -> Finding:
    other = next((other for other in found.others if _world(other) != _world(found.here)), None)
    shown = _shown(other) if other else ""
    return _finding("terminals", other is None, name=other.name if other else "", theirs=shown, ours=_shown(found.here))


def _daemon(found: Surroundings) -> Finding:
    daemon = found.daemon
    well = daemon is None or _world(daemon) == _world(found.here)
    return _finding("daemon", well, state=_shown(daemon) if daemon else "none is running", ours=_shown(found.here))


def _world(terminal: Terminal) -> tuple[str, str]:
    return terminal.domain or "0", terminal.range or "SUBNET"


def _shown(terminal: Terminal) -> str:
    domain, discovery = _world(terminal)
    return f"domain {domain}, range {discovery}"


def _nodes(found: Surroundings) -> Finding:
    names = ", ".join(f"{node.name} (process {node.pid})" for node in found.nodes)
    return _finding("nodes", not found.nodes, names=names, pids=" ".join(str(node.pid) for node in found.nodes))


def _repository(found: Surroundings) -> Finding:
    inner = found.repositories[-1] if found.repositories else ""
    outer = found.repositories[0] if found.repositories else ""
    return _finding("repository", len(found.repositories) <= 1, inner=inner, outer=outer or "none here")


def _limits(found: Surroundings) -> Finding:
    values = {
        "processes": found.processes or "any number of",
        "memory": f"{found.memory / 1e9:.1f}",
        "disk": f"{found.disk / 1e9:.1f}",
        "temporary": tempfile.gettempdir(),
        "enough_processes": ENOUGH_PROCESSES,
        "enough_memory": f"{ENOUGH_MEMORY / 1e9:g}",
        "enough_disk": f"{ENOUGH_DISK / 1e9:g}",
    }
    if found.processes and found.processes < ENOUGH_PROCESSES:
        return _finding("limits", False, "processes", **values)
    if found.memory < ENOUGH_MEMORY:
        return _finding("limits", False, "memory", **values)
    return _finding("limits", found.disk >= ENOUGH_DISK, "disk", **values)
