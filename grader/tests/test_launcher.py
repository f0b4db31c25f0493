"""The launcher for machines without `ros2 launch`: real launch files, real processes, and the real one beside it."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from launch_cases import CASES, HEADER, STARTED, Case

LAUNCHER = Path(__file__).resolve().parents[1] / "lab2_grader" / "ros" / "launcher"
DEADLINE = 30.0  # seconds until a launch that should have ended long before is a failure
PROGRAMS = {
    "numeric_talker": 'echo "args: $*"; echo "to stderr" >&2; printf "last line without newline"',
    "numeric_listener": 'echo "args: $*"',
    "failing": "exit 3",
    "failing_late": 'until [ -e "$TMPDIR/ready" ]; do sleep 0.02; done; rm "$TMPDIR/ready"; exit 3',
    "killing_itself": "kill -9 $$",
    "silent": ":",
    "show_env": 'echo "SHOWN=${SHOWN-unset}"',
    "where": 'echo "cwd: $(pwd)"',
    "is_tty": 'for fd in 1 2; do if [ -t $fd ]; then r="$r $fd yes"; else r="$r $fd no"; fi; done; echo $r',
    "waiting": "trap 'exit 0' INT; echo ready; : >\"$TMPDIR/ready\"; while :; do sleep 0.05; done",
    "deaf": "trap 'echo heard INT' INT; trap '' TERM; echo ready; while :; do sleep 0.05; done",
    "deaf_to_int": "trap '' INT; echo ready; exec sleep 60",
}
SHOW_PARAMETERS = """\
import json, sys, yaml
for flag, value in zip(sys.argv, sys.argv[1:]):
    if flag == "--params-file":
        print(json.dumps(yaml.unsafe_load(open(value, encoding="utf-8")), sort_keys=True))
"""


class Launched(NamedTuple):
    """How a launch ended and what it printed."""

    code: int
    out: str
    err: str

    @property
    def text(self) -> str:
        """All that was printed."""
        return self.out + self.err


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An ament prefix with the package lab2, whose executables are small scripts, and one without executables."""
    prefix = tmp_path_factory.mktemp("prefix")
    index = prefix / "share" / "ament_index" / "resource_index" / "packages"
    launch = prefix / "share" / "lab2" / "launch"
    programs = prefix / "lib" / "lab2"
    for folder in (index, launch, programs):
        folder.mkdir(parents=True)
    for package in ("lab2", "bare"):
        (index / package).touch()
    for name, script in PROGRAMS.items():
        (programs / name).write_text(f"#!/bin/sh\n{script}\n")
    (programs / "show_parameters").write_text(f"#!{sys.executable}\n{SHOW_PARAMETERS}")
    for program in programs.iterdir():
        program.chmod(0o755)
    (launch / "params.yaml").write_text("/**: {ros__parameters: {from_file: 1}}\n")
    (launch / "words").write_text("some words")
    (launch / "broken.py").write_text("def generate_launch_description():\n    return nme\n")
    (launch / "included.py").write_text(
        HEADER
        + "DeclareLaunchArgument('x'), DeclareLaunchArgument('y', default_value='y'),"
        + "say('included', LaunchConfiguration('x'), LaunchConfiguration('y'))])"
    )
    return prefix


@pytest.fixture
def environment(prefix: Path, tmp_path: Path) -> dict[str, str]:
    """The environment of a launch: ours, with the prefix first."""
    environment = dict(os.environ)
    environment.pop("SHOWN", None)
    paths = [str(prefix), *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    environment.update(
        AMENT_PREFIX_PATH=os.pathsep.join(paths),
        ROS_LOG_DIR=str(tmp_path / "log"),
        TMPDIR=str(tmp_path),
        OVERRIDE_LAUNCH_PROCESS_OUTPUT="both",
        PYTHONUNBUFFERED="1",
    )
    return environment


Launch = Callable[..., Launched]


@pytest.fixture
def launch(prefix: Path, environment: dict[str, str]) -> Launch:
    """Launches the text of a launch file and waits for its end."""

    def run(text: str, *arguments: str, options: tuple[str, ...] = (), **more: str) -> Launched:
        write_launch_file(prefix, text)
        argv = [*ours(*options), "lab2", "case.py", *arguments]
        done = subprocess.run(
            argv,
            env={**environment, **more},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=DEADLINE,
            check=False,
        )
        return Launched(done.returncode, done.stdout.decode(), done.stderr.decode())

    return run


def ours(*options: str) -> list[str]:
    """The beginning of the command line of our launcher."""
    return [sys.executable, str(LAUNCHER / "run.py"), *options]


def write_launch_file(prefix: Path, text: str) -> Path:
    """Make *text* the launch file `case.py` of the package."""
    path = prefix / "share" / "lab2" / "launch" / "case.py"
    path.write_text(text, encoding="utf-8")
    return path


def entities(text: str) -> str:
    """A launch file with *text* in its LaunchDescription."""
    return f"{HEADER}{text}\n    ])\n"


# --- launch files -------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_launches(case: Case, launch: Launch) -> None:
    if "show_parameters" in case.entities or "TextSubstitution(text='[" in case.entities:
        pytest.importorskip("yaml")
    done = launch(case.text, *case.arguments)
    assert done.code == case.code, done.text
    for part in case.expect:
        assert part in done.text
    for part in case.absent:
        assert part not in done.text


_VARYING = (
    (re.compile(r"All log files can be found below .*"), "All log files can be found below LOG"),
    (re.compile(r"pid \[?\d+"), "pid PID"),
    (re.compile(r"launch_params_\w+"), "launch_params_X"),
    (re.compile(r"0x[0-9a-f]+"), "ADDRESS"),
    (re.compile(r"(cannot import name '\w+' from '[\w.]+') \(.*\)"), r"\1"),
    # What its XML and YAML readers have against a Python file.
    (
        re.compile(r"RuntimeError: Expected 'launch' as root tag"),
        "InvalidFrontendLaunchFileError: The launch file may have a syntax error, or its format is unknown",
    ),
    (re.compile(r"<lab2_launcher\.[\w.]+|<launch[\w.]*\.(?=[A-Z])[\w]+"), "<OBJECT"),
)


def comparable(done: Launched) -> list[str]:
    """The lines of a launch without what differs from run to run; processes run side by side, so sorted."""
    text = done.out + ("" if done.out.endswith("\n") or not done.out else "\n") + done.err
    for pattern, replacement in _VARYING:
        text = pattern.sub(replacement, text)
    return sorted(line for line in text.split("\n") if line)


@pytest.mark.skipif(shutil.which("ros2") is None, reason="there is no `ros2` on the PATH to compare with")
@pytest.mark.parametrize("case", [case for case in CASES if not case.compare], ids=lambda case: case.name)
def test_does_what_the_real_one_does(case: Case, prefix: Path, launch: Launch, environment: dict[str, str]) -> None:
    mine = launch(case.text, *case.arguments)
    done = subprocess.run(
        ["ros2", "launch", "lab2", "case.py", *case.arguments],
        env={**environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=DEADLINE,
        check=False,
    )
    real = Launched(done.returncode, done.stdout.decode(), done.stderr.decode())
    assert comparable(mine) == comparable(real)
    assert mine.code == real.code


def test_streams_are_told_apart(launch: Launch) -> None:
    done = launch(entities("talker()"))
    assert "[numeric_talker-1] args: --ros-args\n" in done.out
    assert "[numeric_talker-1] last line without newline\n" in done.out
    assert done.err == "[numeric_talker-1] to stderr\n"


def test_sim_time_is_set_for_every_node_and_before_its_own_parameters(launch: Launch) -> None:
    done = launch(
        entities(
            "talker(), talker(parameters=[{'use_sim_time': False}]), say('x'),"
            " IncludeLaunchDescription(HERE + '/case.py') if not os.environ.get('ONCE') and not"
            " os.environ.update(ONCE='1') else say('y')"
        ),
        options=("--use-sim-time",),
    )
    assert done.code == 0, done.text
    lines = [line.split("args: ")[1] for line in done.out.splitlines() if " args: " in line]
    assert len(lines) == 4
    for line in lines:
        assert line.startswith("--ros-args -p use_sim_time:=True")
    assert sum(" --params-file " in line for line in lines) == 2


def test_sim_time_reaches_a_real_node(launch: Launch, prefix: Path) -> None:
    pytest.importorskip("rclpy")
    program = prefix / "lib" / "lab2" / "real_node"
    program.write_text(
        f"#!{sys.executable}\n"
        + textwrap.dedent(
            """\
            import rclpy
            from rclpy.node import Node

            rclpy.init()
            node = Node("real", allow_undeclared_parameters=True, automatically_declare_parameters_from_overrides=True)
            for name in ("use_sim_time", "i", "f", "e", "b", "s", "no", "num", "l", "lf", "ls", "lb", "nested.a"):
                print(name, repr(node.get_parameter(name).value))
            print(node.get_fully_qualified_name(), node.resolve_topic_name("chatter"))
            rclpy.shutdown()
            """
        )
    )
    program.chmod(0o755)
    done = launch(
        entities(
            "Node(package='lab2', executable='real_node', name='n', namespace='m', remappings=[('chatter', 'c')],"
            " parameters=[{'i': 1, 'f': 2.0, 'e': 1e-7, 'b': True, 's': 'a \"b\" \\\\ \\n ü 😀', 'no': 'no', 'num': '12',"
            " 'l': [1, 2], 'lf': [1, 2.5], 'ls': ['a', 'true'], 'lb': [True, False], 'nested': {'a': 'b'}}])"
        ),
        options=("--use-sim-time",),
    )
    assert done.code == 0, done.text
    for line in (
        "use_sim_time True",
        "i 1",
        "f 2.0",
        "e 1e-07",
        "b True",
        "s 'a \"b\" \\\\ \\n ü 😀'",
        "no 'no'",
        "num '12'",
        "l [1, 2]",
        "lf [1.0, 2.5]",
        "ls ['a', 'true']",
        "lb [True, False]",
        "nested.a 'b'",
        "/m/n /m/c",
    ):
        assert f"[real_node-1] {line}\n" in done.out


# --- the command line ---------------------------------------------------------------------------


def run_command(environment: dict[str, str], *arguments: str) -> Launched:
    done = subprocess.run([*ours(), *arguments], env=environment, capture_output=True, timeout=DEADLINE, check=False)
    return Launched(done.returncode, done.stdout.decode(), done.stderr.decode())


def test_package_missing(environment: dict[str, str], prefix: Path) -> None:
    done = run_command({**environment, "AMENT_PREFIX_PATH": str(prefix)}, "lab9", "x.py")
    assert (done.code, done.out) == (1, "")
    assert done.err == f"Package 'lab9' not found: \"package 'lab9' not found, searching: ['{prefix}']\"\n"


def test_launch_file_missing(environment: dict[str, str], prefix: Path) -> None:
    done = run_command(environment, "lab2", "nope.py")
    share = prefix / "share" / "lab2"
    assert (done.code, done.out) == (1, "")
    assert done.err == (
        f"file 'nope.py' was not found in the share directory of package 'lab2' which is at '{share}'\n"
    )


def test_launch_file_found_twice(environment: dict[str, str], prefix: Path) -> None:
    paths = [prefix / "share" / "lab2" / folder / "twice.py" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir(exist_ok=True)
        path.touch()
    done = run_command(environment, "lab2", "twice.py")
    assert done.code == 1
    assert "file 'twice.py' was found more than once in the share directory of package 'lab2': [" in done.err


def test_malformed_argument(environment: dict[str, str], prefix: Path) -> None:
    write_launch_file(prefix, entities(""))
    done = run_command(environment, "lab2", "case.py", "a=b")
    assert (done.code, done.err) == (1, "malformed launch argument 'a=b', expected format '<name>:=<value>'\n")


def test_usage(environment: dict[str, str]) -> None:
    assert run_command(environment, "lab2").code == 2


# --- refusals -----------------------------------------------------------------------------------

UNSUPPORTED = {
    "class": (
        "LifecycleNode(name='a', namespace='', package='lab2', executable='x')",
        "launch_ros.actions.LifecycleNode",
    ),
    "attribute": ("talker().get_stdout()", "Node.get_stdout"),
    "context": ("OpaqueFunction(function=lambda context: context.asyncio_loop)", "LaunchContext.asyncio_loop"),
    "substitutions-in-file": ("talker(parameters=[ParameterFile('x', allow_substs=True)])", "ParameterFile("),
    "private": ("OpaqueFunction(function=lambda context: context._event_queue)", "LaunchContext._event_queue"),
    "xml": ("IncludeLaunchDescription(HERE + '/a.launch.xml')", "launch file a.launch.xml: only Python"),
    "coroutine": ("OpaqueCoroutine(coroutine=None)", "launch.actions.OpaqueCoroutine"),
    "other-package": ("__import__('xacro').process_file('x')", "xacro.process_file"),
    "swallowed": ("OpaqueFunction(function=swallow)", "LaunchContext.asyncio_loop"),
}


@pytest.mark.parametrize("name", UNSUPPORTED)
def test_refuses_by_name(name: str, launch: Launch) -> None:
    text, what = UNSUPPORTED[name]
    more = (
        "from launch_ros.actions import LifecycleNode\n"
        "def swallow(context):\n    try:\n        context.asyncio_loop\n    except BaseException:\n        pass\n"
    )
    done = launch(more + entities(text))
    assert done.code == 78, done.text
    assert done.err.startswith(f"[lab2-launcher] unsupported: {what}")
    assert done.err.count("\n") == 1


def test_an_unused_import_is_not_refused(launch: Launch) -> None:
    done = launch(
        "from launch_ros.actions import LifecycleNode, ComposableNodeContainer, LoadComposableNodes\n"
        "from launch_ros.descriptions import ComposableNode\n"
        "from launch import LaunchService, LaunchIntrospector\n"
        "from launch_xml.launch_description_sources import XMLLaunchDescriptionSource\n"
        "import launch_ros.events.lifecycle\n" + entities("talker()")
    )
    assert done.code == 0, done.text
    assert STARTED in done.out


def test_a_launch_file_in_xml_is_refused(environment: dict[str, str], prefix: Path) -> None:
    (prefix / "share" / "lab2" / "launch" / "chat.launch.xml").write_text("<launch/>")
    done = run_command(environment, "lab2", "chat.launch.xml")
    assert done.code == 78
    assert (
        done.err == "[lab2-launcher] unsupported: launch file chat.launch.xml: only Python launch files are supported\n"
    )


def test_a_refusal_leaves_no_process_behind(launch: Launch, environment: dict[str, str]) -> None:
    done = launch(
        entities(
            "Node(package='lab2', executable='deaf'),"
            " TimerAction(period=0.5, actions=[OpaqueFunction(function=lambda context: context.asyncio_loop)])"
        )
    )
    assert done.code == 78
    assert not alive(pid_of(done.out, "deaf-1"))


def test_the_arguments_of_our_classes_are_those_of_the_real_ones() -> None:
    code = textwrap.dedent(
        """\
        import importlib, inspect, sys
        sys.path.insert(0, sys.argv[1])
        from lab2_launcher import api
        api.install()
        inner = {"matcher", "action_matcher", "on_event", "target_action_cls", "target_event_cls"}  # set by the class
        checked = 0
        for line in open(sys.argv[1] + "/lab2_launcher/jazzy_names.txt", encoding="utf-8"):
            head, _, names = line.strip().partition("( ") if "( " in line else (line.strip().rstrip("("), "", "")
            if "(" not in line:
                continue
            module, _, name = head.rpartition(".")
            kind = getattr(importlib.import_module(module), name, None)
            if not isinstance(kind, type) or isinstance(kind, api._StandIn) or kind.__name__ != name:
                continue
            found = []
            for base in kind.__mro__[:-1]:
                if "__init__" in vars(base):
                    parameters = list(inspect.signature(base.__init__).parameters.values())[1:]
                    found += [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
                    if not any(p.kind is p.VAR_KEYWORD for p in parameters):
                        break
            if issubclass(kind, BaseException):
                continue
            missing = set(names.split()) - set(found) - inner
            surplus = set(found) - set(names.split())
            checked += 1
            if missing or surplus:
                print(head, "missing", sorted(missing), "surplus", sorted(surplus))
        print("checked", checked)
        """
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(LAUNCHER)], capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert done.returncode == 0, done.stderr
    *differences, last = done.stdout.splitlines()
    assert differences == []
    assert int(last.split()[1]) > 60


def test_the_list_of_names_is_that_of_the_real_packages() -> None:
    real = subprocess.run(
        [sys.executable, "-c", "import launch.launch_service, launch_ros.actions"],
        capture_output=True,
        timeout=DEADLINE,
        check=False,
    )
    if real.returncode:
        pytest.skip("`launch` and `launch_ros` cannot be imported here")
    done = subprocess.run(
        [sys.executable, str(LAUNCHER / "update_names.py"), "--print"],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert done.stdout == (LAUNCHER / "lab2_launcher" / "jazzy_names.txt").read_text(encoding="utf-8"), done.stderr


# --- ros2 in launch files -----------------------------------------------------------------------


def without_ros2(environment: dict[str, str]) -> str:
    """The PATH without the folders that have a `ros2`."""
    folders = environment["PATH"].split(os.pathsep)
    return os.pathsep.join(folder for folder in folders if not os.path.exists(os.path.join(folder, "ros2")))


def test_ros2_run(launch: Launch, environment: dict[str, str]) -> None:
    done = launch(
        entities(
            "ExecuteProcess(cmd=['ros2', 'run', 'lab2', 'numeric_talker', '--ros-args', '-r', 'a:=b']),"
            " ExecuteProcess(cmd=['ros2 run lab2 numeric_listener'], shell=True),"
            " ExecuteProcess(cmd=['ros2', 'run', 'lab2', 'nope']), ExecuteProcess(cmd=['ros2', 'run', 'lab9', 'nope']),"
            " ExecuteProcess(cmd=[FindExecutable(name='ros2'), 'run', 'lab2', 'silent'])"
        ),
        PATH=without_ros2(environment),
    )
    assert "[ros2-1] args: --ros-args -r a:=b\n" in done.out
    assert "[ros2 run lab2 numeric_listener-2] args: \n" in done.out
    assert "[ros2-3] No executable found\n" in done.err
    assert "[ros2-4] Package 'lab9' not found\n" in done.err
    assert "[ros2-5]: process has finished cleanly" in done.out


def test_ros2_launch(launch: Launch, environment: dict[str, str]) -> None:
    done = launch(
        entities("ExecuteProcess(cmd=['ros2', 'launch', 'lab2', 'included.py', 'x:=4'])"),
        PATH=without_ros2(environment),
    )
    assert "[ros2-1] [echo-1] included 4 y\n" in done.out


def test_other_ros2_commands_are_refused(launch: Launch, environment: dict[str, str]) -> None:
    done = launch(
        entities(
            "ExecuteProcess(cmd=['ros2', 'topic', 'echo', '/chatter']), Node(package='lab2', executable='waiting')"
        ),
        PATH=without_ros2(environment),
    )
    assert done.code == 78, done.text
    assert "[lab2-launcher] unsupported: ros2 topic\n" in done.err.splitlines(keepends=True)


# --- signals ------------------------------------------------------------------------------------


class Running:
    """A launch that goes on until it is told to end; its output is read as it comes."""

    def __init__(self, argv: list[str], environment: dict[str, str], folder: Path) -> None:
        self.paths = folder / "out", folder / "err"
        with self.paths[0].open("wb") as out, self.paths[1].open("wb") as err:
            self.process = subprocess.Popen(argv, env=environment, stdin=subprocess.DEVNULL, stdout=out, stderr=err)

    @property
    def out(self) -> str:
        return self.paths[0].read_text(encoding="utf-8", errors="replace")

    def wait_for(self, part: str) -> None:
        until(lambda: part in self.out, f"{part!r} in the output")

    def end(self, *numbers: int) -> Launched:
        for number in numbers:
            self.process.send_signal(number)
        code = self.process.wait(DEADLINE)
        return Launched(code, self.out, self.paths[1].read_text(encoding="utf-8"))


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait until *condition* holds."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.01)


def pid_of(out: str, name: str) -> int:
    """The process id that a launch gave for *name*."""
    match = re.search(rf"\[{name}\]: process started with pid \[(\d+)\]", out)
    assert match
    return int(match.group(1))


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def start(prefix: Path, environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Running]]:
    """Starts a launch without waiting for its end."""
    started: list[Running] = []

    def run(text: str, *arguments: str) -> Running:
        write_launch_file(prefix, entities(text))
        started.append(Running([*ours(), "lab2", "case.py", *arguments], environment, tmp_path))
        return started[-1]

    yield run
    for running in started:
        if running.process.poll() is None:
            running.process.kill()
            running.process.wait()


Start = Callable[..., Running]
TWO_WAITING = "Node(package='lab2', executable='waiting'), Node(package='lab2', executable='waiting')"


def test_interrupt(start: Start) -> None:
    running = start(TWO_WAITING)
    running.wait_for("[waiting-1] ready")
    running.wait_for("[waiting-2] ready")
    done = running.end(signal.SIGINT)
    assert done.code == 0
    for line in (
        "[WARNING] [launch]: user interrupted with ctrl-c (SIGINT)",
        "[INFO] [waiting-1]: sending signal 'SIGINT' to process[waiting-1]",
        "[INFO] [waiting-2]: sending signal 'SIGINT' to process[waiting-2]",
        "[INFO] [waiting-1]: process has finished cleanly [pid ",
        "[INFO] [waiting-2]: process has finished cleanly [pid ",
    ):
        assert line in done.out


@pytest.mark.skipif(shutil.which("ros2") is None, reason="there is no `ros2` on the PATH to compare with")
def test_interrupt_as_the_real_one(start: Start, environment: dict[str, str], tmp_path: Path) -> None:
    running = start(TWO_WAITING)
    real = tmp_path / "real"
    real.mkdir()
    beside = Running(["ros2", "launch", "lab2", "case.py"], environment, real)
    results = []
    for one in (running, beside):
        one.wait_for("[waiting-1] ready")
        one.wait_for("[waiting-2] ready")
        results.append(one.end(signal.SIGINT))
    assert comparable(results[0]) == comparable(results[1])
    assert results[0].code == results[1].code


def test_terminate_leaves_no_process_behind(start: Start) -> None:
    running = start("Node(package='lab2', executable='waiting')")
    running.wait_for("[waiting-1] ready")
    done = running.end(signal.SIGTERM)
    assert done.code == 1
    assert "ctrl-c" not in done.out
    assert "[INFO] [waiting-1]: sending signal 'SIGINT' to process[waiting-1]" in done.out
    assert not alive(pid_of(done.out, "waiting-1"))


def test_the_ladder_against_a_process_that_does_not_listen(start: Start) -> None:
    running = start(
        "DeclareLaunchArgument('sigkill_timeout', default_value='0.4'),"
        " Node(package='lab2', executable='deaf', sigterm_timeout='0.3')"
    )
    running.wait_for("[deaf-1] ready")
    done = running.end(signal.SIGINT)
    order = [
        "[INFO] [deaf-1]: sending signal 'SIGINT' to process[deaf-1]",
        "[deaf-1] heard INT",
        "failed to terminate '0.3' seconds after receiving 'SIGINT', escalating to 'SIGTERM'",
        "[INFO] [deaf-1]: sending signal 'SIGTERM' to process[deaf-1]",
        "[ERROR] [deaf-1]: process[deaf-1] failed to terminate '0.7' seconds after receiving 'SIGTERM', escalating to",
        "[INFO] [deaf-1]: sending signal 'SIGKILL' to process[deaf-1]",
        "[ERROR] [deaf-1]: process has died [pid ",
    ]
    places = [done.out.find(line) for line in order]
    assert -1 not in places, done.out
    assert places == sorted(places)
    assert "exit code -9, cmd '" in done.out


def test_the_default_timeouts_are_five_seconds(start: Start) -> None:
    running = start("Node(package='lab2', executable='deaf_to_int')")
    running.wait_for("[deaf_to_int-1] ready")
    begun = time.monotonic()
    done = running.end(signal.SIGINT)
    assert "failed to terminate '5' seconds after receiving 'SIGINT', escalating to 'SIGTERM'" in done.out
    assert "exit code -15, cmd '" in done.out
    assert time.monotonic() - begun >= 4.9


def test_terminate_after_interrupt_does_not_wait(start: Start) -> None:
    running = start("Node(package='lab2', executable='deaf_to_int')")
    running.wait_for("[deaf_to_int-1] ready")
    running.process.send_signal(signal.SIGINT)
    running.wait_for("sending signal 'SIGINT'")
    begun = time.monotonic()
    done = running.end(signal.SIGTERM)
    assert "exit code -15, cmd '" in done.out
    assert time.monotonic() - begun < 4.0


def test_interrupted_twice(start: Start) -> None:
    running = start("Node(package='lab2', executable='deaf', sigterm_timeout='0.5', sigkill_timeout='0.1')")
    running.wait_for("[deaf-1] ready")
    running.process.send_signal(signal.SIGINT)
    running.wait_for("ctrl-c (SIGINT)\n")
    done = running.end(signal.SIGINT)
    assert "[WARNING] [launch]: user interrupted with ctrl-c (SIGINT) again, ignoring..." in done.out


def test_interrupt_while_a_respawn_waits(start: Start) -> None:
    running = start("Node(package='lab2', executable='failing', respawn=True, respawn_delay=60.0)")
    running.wait_for("process has died")
    assert running.end(signal.SIGINT).code == 0


def test_ends_when_nobody_reads_any_more(start: Start, prefix: Path, environment: dict[str, str]) -> None:
    write_launch_file(prefix, entities("ExecuteProcess(cmd=['yes'])"))
    process = subprocess.Popen(
        [*ours(), "lab2", "case.py"], env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    first = process.stdout.read(4096).decode()
    process.stdout.close()
    process.wait(DEADLINE)
    assert not alive(pid_of(first, "yes-1"))


# --- amounts ------------------------------------------------------------------------------------


def test_a_line_of_100_megabytes_does_not_fill_the_memory(launch: Launch) -> None:
    code = (
        # not ru_maxrss, which a process takes over from whoever starts it
        "import re\\n"
        "def after(event, context):\\n"
        "    status = open('/proc/self/status').read()\\n"
        "    return [LogInfo(msg='peak ' + re.search('VmHWM:[^0-9]*([0-9]+)', status)[1])]\\n"
    )
    done = launch(
        code.replace("\\n", "\n")
        + entities(
            "(p := ExecuteProcess(cmd=['head -c 100000000 /dev/zero | tr \"\\\\\\\\0\" x; echo; echo after'],"
            " shell=True, name='flood')), RegisterEventHandler(OnProcessExit(target_action=p, on_exit=after))"
        )
    )
    lines = done.out.splitlines()
    flood = [line for line in lines if line.startswith("[flood-1] ")]
    assert len(flood) == 2
    assert flood[0].startswith("[flood-1] xxxx")
    assert 16_000 < len(flood[0]) < 100_000
    assert flood[0].endswith(" [line cut by the launcher]")
    assert flood[1] == "[flood-1] after"
    peak = int(next(line for line in lines if "peak " in line).split("peak ")[1])
    assert peak < 100_000  # kilobytes


def test_many_lines_all_come_through(launch: Launch) -> None:
    done = launch(entities("ExecuteProcess(cmd=['seq', '200000'], name='seq')"))
    numbers = [line.split()[1] for line in done.out.splitlines() if line.startswith("[seq-1] ")]
    assert numbers == [str(number) for number in range(1, 200_001)]


def test_lines_of_two_processes_stay_whole(launch: Launch) -> None:
    done = launch(entities("ExecuteProcess(cmd=['seq', '1', '30000']), ExecuteProcess(cmd=['seq', '1', '30000'])"))
    for number in (1, 2):
        lines = [line for line in done.out.splitlines() if line.startswith(f"[seq-{number}] ")]
        assert lines == [f"[seq-{number}] {count}" for count in range(1, 30_001)]


def test_bytes_that_are_no_text(launch: Launch) -> None:
    done = launch(entities("ExecuteProcess(cmd=['printf', r'\\377\\303\\244'], name='p')"))
    assert "[p-1] \ufffdä\n" in done.out


# --- by itself ----------------------------------------------------------------------------------


def test_needs_nothing_but_the_standard_library(prefix: Path, tmp_path: Path) -> None:
    write_launch_file(prefix, entities("talker(name='a', parameters=[{'x': 1}])"))
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(LAUNCHER / "run.py"), "lab2", "case.py"],
        env={"AMENT_PREFIX_PATH": str(prefix), "PATH": os.environ["PATH"], "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert STARTED in done.stdout


def test_the_stand_in_for_ros2_can_be_executed() -> None:
    assert os.access(LAUNCHER / "bin" / "ros2", os.X_OK)
