"""Which ROS is here, and how its programs are started."""

from __future__ import annotations

import compileall
import functools
import importlib.util
import os
import shutil
import sys
import sysconfig
from pathlib import Path

from lab2_grader import lab, process
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.records import Record

HERE = Path(__file__).parent
LAUNCHER = HERE / "launcher"
TIME_LAPSE_LAUNCH = HERE / "time_lapse_launch.py"
DISCOVERY_PROFILE = HERE / "quick_discovery.xml"


class Ros(Record, frozen=True):
    """The ROS that is used.

    Args:
        kind: `sourced` or `wheels`.
        distro: For example `jazzy`.
        prefixes: Where its packages are, as `AMENT_PREFIX_PATH` has them.
        python_path: What it adds to `PYTHONPATH`.
        library_path: What it needs in `LD_LIBRARY_PATH`.
        path: Where its programs are.
        has_ros2_launch: Whether the real `ros2 launch` is used.
    """

    kind: str
    distro: str
    prefixes: tuple[str, ...]
    python_path: tuple[str, ...]
    library_path: tuple[str, ...]
    path: tuple[str, ...]
    has_ros2_launch: bool

    def environment(self, home: str, installed: str | None = None) -> tuple[tuple[str, str], ...]:
        """The whole environment of a process that uses this ROS.

        Args:
            home: A folder it may write to.
            installed: The install prefix of the submission's package, when it is to be found too.
        """
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        own_python = (f"{installed}/lib/{version}/site-packages",) if installed else ()
        prefixes = ((installed,) if installed else ()) + self.prefixes
        values = {
            "PATH": ":".join((*self.path, "/usr/local/bin", "/usr/bin", "/bin")),
            "HOME": home,
            "TMPDIR": "/tmp",
            "LANG": "C.UTF-8",
            "AMENT_PREFIX_PATH": ":".join(prefixes),
            "PYTHONPATH": ":".join((*own_python, *self.python_path)),
            "LD_LIBRARY_PATH": ":".join(self.library_path),
            "ROS_DISTRO": self.distro,
            "ROS_VERSION": "2",
            "ROS_PYTHON_VERSION": "3",
            "ROS_LOG_DIR": f"{home}/.ros/log",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
            "FASTDDS_DEFAULT_PROFILES_FILE": str(DISCOVERY_PROFILE),
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(DISCOVERY_PROFILE),
            "PYTHONUNBUFFERED": "1",
            # rclpy imports numpy, whose OpenBLAS would start a thread for each core in every node: a fifth of its start.
            "OPENBLAS_NUM_THREADS": "1",
            "OVERRIDE_LAUNCH_PROCESS_OUTPUT": "both",
            "RCUTILS_COLORIZED_OUTPUT": "0",
        }
        if self.kind == "wheels":
            values["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
        return tuple((name, value) for name, value in values.items() if value)

    def reads(self) -> tuple[str, ...]:
        """Host paths that a process with this ROS must be able to read, besides the system and the interpreter."""
        outside = [p for p in self.prefixes if not Path(p).is_relative_to("/usr") and Path(p) != Path(sys.prefix)]
        return (*outside, str(LAUNCHER), str(TIME_LAPSE_LAUNCH), str(DISCOVERY_PROFILE))

    @property
    def launcher(self) -> str:
        """The program or file that launches; without it no launch file can be right."""
        return "ros2" if self.has_ros2_launch else str(LAUNCHER / "run.py")

    def launch_argv(self, package: str, launch_file: str, path: str, time_lapse: bool) -> tuple[str, ...]:
        """The command that launches *launch_file* of *package*.

        Args:
            package: Name of the package.
            launch_file: Name of the file, as `ros2 launch` takes it.
            path: Where that file stands inside the sandbox.
            time_lapse: Whether the nodes are to follow the ROS clock (`use_sim_time`).
        """
        if not self.has_ros2_launch:
            follow = ("--use-sim-time",) if time_lapse else ()
            return (process.PYTHON, self.launcher, *follow, package, launch_file)
        if time_lapse:
            return ("ros2", "launch", str(TIME_LAPSE_LAUNCH), f"launch_file:={path}")
        return ("ros2", "launch", package, launch_file)


@functools.cache
def byte_compile() -> None:
    """Byte-compile the grader's own modules where they stand, as pip does.

    Observers and launchers, which are started for every submission, see them read-only and would compile them each time.
    Does nothing where it may not write.
    """
    compileall.compile_dir(HERE.parent, quiet=2, workers=1)


def find(wanted: str = "auto") -> Ros:
    """The ROS to use: the sourced one where there is one, else the wheels beside this Python.

    Args:
        wanted: `auto`, `sourced` or `wheels`.

    Raises:
        UsageError: *wanted* is not to be had here, or another distribution of ROS is sourced than the lab's.
        FaultError: Neither is there.
    """
    sourced = None if wanted == "wheels" else _sourced()  # whatever is sourced does not matter then
    wheels = _wheels()
    if wanted == "sourced" and sourced is None:
        raise UsageError(
            "ROS 2 is not sourced in this terminal. Run `source /opt/ros/jazzy/setup.bash` first, or use --ros wheels."
        )
    if wanted == "wheels" and wheels is None:
        raise UsageError("The ROS wheels are not installed beside this Python. Run `make setup` first.")
    found = {"auto": sourced or wheels, "sourced": sourced, "wheels": wheels}[wanted]
    if found is None:
        raise FaultError("Neither a sourced ROS 2 nor the ROS wheels are here. Run `make setup`, or source ROS 2.")
    return found


@functools.cache
def _sourced() -> Ros | None:
    distro = os.environ.get("ROS_DISTRO", "")
    prefixes = tuple(filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")))
    program = shutil.which("ros2")
    if not (distro and prefixes and program):
        return None
    if distro != lab.course().ros_distro:
        raise UsageError(
            f"ROS 2 {distro} is sourced here; the lab uses {lab.course().ros_distro}. "
            "Source that one, or use --ros wheels."
        )
    # Only what belongs to ROS itself: an overlay workspace of the caller's must not reach a submission.
    underlays = tuple(p for p in prefixes if Path(p, "share", "rclpy").is_dir() or Path(p, "share", "ros2cli").is_dir())
    kept = underlays or prefixes
    return Ros(
        kind="sourced",
        distro=distro,
        prefixes=kept,
        python_path=_below(os.environ.get("PYTHONPATH", ""), kept),
        library_path=_below(os.environ.get("LD_LIBRARY_PATH", ""), kept),
        path=(str(Path(program).parent), str(Path(process.PYTHON).parent)),
        has_ros2_launch=True,
    )


def _below(value: str, prefixes: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(p for p in value.split(":") if p and any(Path(p).is_relative_to(prefix) for prefix in prefixes))


@functools.cache
def _wheels() -> Ros | None:
    if importlib.util.find_spec("ros_wheels_bootstrapper") is None:
        return None
    packages = Path(sysconfig.get_paths()["platlib"])
    libraries = (str(Path(sys.prefix, "lib")), *sorted(str(p) for p in packages.glob("ros_*.libs")))
    return Ros(
        kind="wheels",
        distro=lab.course().ros_distro,
        prefixes=(sys.prefix,),
        python_path=(),
        library_path=libraries,
        path=(str(Path(process.PYTHON).parent),),
        has_ros2_launch=False,
    )
