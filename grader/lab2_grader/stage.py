"""Plays the scenes of one submission: which, with what, side by side, each observed by a process of its own.

Observers take longer to start than to observe, so they are started while the submission is still being built and wait
for their plan. What they say goes to the evidence file as it comes.
"""

from __future__ import annotations

import random
import re
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec

from lab2_grader import lab, process, sandbox
from lab2_grader.build import without_function
from lab2_grader.errors import FaultError
from lab2_grader.evidence import SceneEntry, Writer, events
from lab2_grader.records import (
    Build,
    Clock,
    EndedBy,
    Endpoint,
    Limits,
    Message,
    ProcessGone,
    ProcessSeen,
    Request,
    Scene,
    SceneName,
    ScenePlan,
    renews_publisher,
)
from lab2_grader.ros import Ros
from lab2_grader.ros.domains import Domain
from lab2_grader.stand_in import launched, program

REMAPPING = re.compile(r" (?:-r|--remap) (\S+:=\S+)")
INSTALLED = f"{sandbox.WORKSPACE}/install"
OBSERVER_OUTPUT_BYTES = 100_000_000  # more than it can have to say: what it keeps of a scene is limited
OBSERVER_MEMORY_BYTES = 1_000_000_000  # beyond what the submission may use
OBSERVER_GRACE_SECONDS = 30.0
EARLY_OBSERVERS = 3  # conversation, listener, originals: what a normal submission needs
HEAD_START_SECONDS = 1.0  # of a scene over the next, at most; it ends sooner when its graph is there
GRAPH_IS_THERE = b'"graph"'  # as the observer writes the name of that phase
WORDS = (
    "amber",
    "birch",
    "cobalt",
    "delta",
    "ember",
    "fjord",
    "garnet",
    "heron",
    "indigo",
    "juniper",
    "kestrel",
    "lilac",
)

# Runs a module's main without its entry point: for a package whose setup.py does not name it.
RUN_MODULE = (
    "import importlib, runpy, sys\n"
    "name = sys.argv.pop(1)\n"
    "main = getattr(importlib.import_module(name), 'main', None)\n"
    "sys.exit(main() if main else runpy.run_module(name, run_name='__main__') and None)\n"
)


class _Observer:
    """An observer's process: started early, told its plan later."""

    def __init__(self, ros: Ros, isolation: sandbox.Isolation, home: Path) -> None:
        self._sink: Callable[[bytes], object] | None = None
        self._errors = bytearray()
        self._domain = None if isolation.on else Domain()
        self._world = self._domain.environment() if self._domain else ()
        environment = dict(ros.environment(str(home)) + self._world)
        here = str(Path(__file__).parent.parent)
        environment["PYTHONNOUSERSITE"] = "1"
        environment["PYTHONPATH"] = ":".join(filter(None, (here, environment.get("PYTHONPATH", ""))))
        conversation = lab.limits().conversation
        seconds = conversation.realtime_seconds + conversation.timelapse_seconds + OBSERVER_GRACE_SECONDS
        request = Request(
            argv=(process.PYTHON, "-m", "lab2_grader.observe"),
            env=tuple(environment.items()),
            cwd="/",
            limits=Limits(
                seconds=seconds,
                output_bytes=OBSERVER_OUTPUT_BYTES,
                memory_bytes=OBSERVER_MEMORY_BYTES + lab.limits().resources.memory_bytes,
            ),
        )
        try:
            confined = sandbox.private_network(request, isolation)
            self._process = process.Process(confined, self._on_output, keep_stdin=True)
        except FaultError:
            if self._domain is not None:
                self._domain.close()
            raise

    def _on_output(self, stream: str, data: bytes) -> None:
        if stream == "stderr":
            self._errors += data[: max(0, 20_000 - len(self._errors))]
        elif self._sink is not None:
            self._sink(data)

    def play(self, plan: ScenePlan, started_with: str, path: Path, started: threading.Event) -> Scene:
        """Play *plan*, writing what is observed to *path*, and return it; sets *started* when its graph is there."""
        began = time.monotonic()
        with path.open("wb", buffering=0) as file:

            def sink(data: bytes) -> None:
                file.write(data)
                if GRAPH_IS_THERE in data:
                    started.set()

            self._sink = sink
            program = msgspec.structs.replace(plan.program, env=plan.program.env + self._world)
            self._process.send(msgspec.json.encode(msgspec.structs.replace(plan, program=program)) + b"\n")
            outcome = self._process.wait()
        complete = outcome.code == 0 and not outcome.dropped_bytes
        fault = ""
        if not complete:
            said = self._errors.decode(errors="replace").strip().splitlines()
            last = said[-1] if said else f"exit code {outcome.code}, signal {outcome.signal}"
            fault = f"The observer of the scene '{plan.scene.value}' did not come to its end ({last})."
        seconds = round(time.monotonic() - began, 2)
        found = events(path.read_bytes())
        return Scene(plan.scene, started_with, plan.label, plan.clock, complete, fault, seconds, found)

    def dismiss(self) -> None:
        """End an observer; one that has played its scene does not mind."""
        if self._process.running:
            self._process.stop(EndedBy.GRADER)
            self._process.wait()
        if self._domain is not None:
            self._domain.close()


class Stage:
    """The scenes of one submission.

    Args:
        ros: With which ROS.
        isolation: Whether there are walls.
        writer: Where evidence goes.
        home: A private directory for the observers.
        clock: How the numeric pair is to be driven.
        seed: Of the numbers that are made up; None for the machine's own randomness.

    Raises:
        FaultError: An observer cannot be started.
    """

    def __init__(
        self,
        ros: Ros,
        isolation: sandbox.Isolation,
        writer: Writer,
        home: Path,
        clock: Clock,
        seed: int | None = None,
    ) -> None:
        self._ros = ros
        self._isolation = isolation
        self._writer = writer
        self._home = home
        self._clock = clock
        self._random = random.Random(seed)  # noqa: S311 - numbers to look for, no secrets
        self._observers: list[_Observer] = []
        try:
            self._waiting = [self._observer() for _ in range(EARLY_OBSERVERS)]
        except FaultError:
            self._dismiss_all()
            raise

    def _observer(self) -> _Observer:
        observer = _Observer(self._ros, self._isolation, self._home)
        self._observers.append(observer)
        return observer

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *exception: object) -> None:
        self._dismiss_all()

    def _dismiss_all(self) -> None:
        """End every observer, and with it whatever of the submission it had started."""
        for observer in self._observers:
            observer.dismiss()

    def play(self, build: Build, installed: Path) -> tuple[Scene, ...]:
        """Play every scene that this build allows, side by side.

        Each begins when the programs of the one before are there, the longest first: all at once would keep each other from
        starting.

        Args:
            build: What was built.
            installed: Where it was unpacked: the folder that holds `install/`.

        Raises:
            FaultError: An observer could not be started.
        """
        specification = lab.specification()
        numeric, original = specification.numeric, specification.original
        jobs: list[Callable[[threading.Event], tuple[Scene, ...]]] = [
            lambda started: self._conversation_and_talker(build, installed, started)
        ]
        if _launch_path(build, original.launch_file):
            jobs.append(
                lambda started: (
                    self._launched(SceneName.ORIGINALS, build, installed, original, started, Clock.REAL_TIME),
                )
            )
        if self._single(numeric.listener, build, installed) is not None:
            jobs.append(lambda started: (self._listener(build, installed, started),))
        with ThreadPoolExecutor(max_workers=len(jobs)) as pool:
            futures: list[Future[tuple[Scene, ...]]] = []
            try:
                for job in jobs:
                    started = threading.Event()
                    futures.append(pool.submit(job, started))
                    started.wait(HEAD_START_SECONDS)
                scenes = {scene.name: scene for future in futures for scene in future.result()}
            except BaseException:
                self._dismiss_all()
                raise
        if remappings := _remappings_that_help(scenes, launched(numeric.listener, build)):
            scenes[SceneName.LISTENER] = self._listener(build, installed, threading.Event(), remappings)
        return tuple(scenes[name] for name in SceneName if name in scenes)

    # --- one scene each ---------------------------------------------------------------------

    def _conversation_and_talker(self, build: Build, installed: Path, started: threading.Event) -> tuple[Scene, ...]:
        scenes: tuple[Scene, ...] = ()
        numeric = lab.specification().numeric
        if _launch_path(build, numeric.launch_file):
            conversation = self._launched(SceneName.CONVERSATION, build, installed, numeric, started, self._clock)
            if _makes_publishers(conversation):
                conversation = self._launched(
                    SceneName.CONVERSATION, build, installed, numeric, started, Clock.REAL_TIME
                )
            scenes = (conversation,)
            if _shows_talker(conversation, launched(numeric.talker, build)):
                return scenes
        talker = self._talker(build, installed, started, self._clock)
        if talker is not None and (_died_silent(talker) or _makes_publishers(talker)):
            talker = self._talker(build, installed, started, Clock.REAL_TIME)
        return (*scenes, talker) if talker is not None else scenes

    def _talker(self, build: Build, installed: Path, started: threading.Event, clock: Clock) -> Scene | None:
        """The talker by itself; None when there is nothing to start."""
        follow = ("-p", "use_sim_time:=true") if clock is Clock.TIME_LAPSE else ()
        single = self._single(lab.specification().numeric.talker, build, installed, follow)
        if single is None:
            return None
        how, label, request = single
        return self._play(ScenePlan(SceneName.TALKER, clock, request, label), how, started)

    def _launched(
        self, name: SceneName, build: Build, installed: Path, pair: lab.Pair, started: threading.Event, clock: Clock
    ) -> Scene:
        package = lab.specification().package
        path = f"{self._prefix(installed)}/share/{package}/{_launch_path(build, pair.launch_file)}"
        argv = self._ros.launch_argv(package, pair.launch_file, path, clock is Clock.TIME_LAPSE)
        request = self._confined(argv, installed)
        is_original = name is SceneName.ORIGINALS
        talker, listener = (n if is_original else launched(n, build) for n in (pair.talker, pair.listener))
        return self._play(ScenePlan(name, clock, request, "", talker, listener), "launch", started)

    def _listener(
        self, build: Build, installed: Path, started: threading.Event, remappings: tuple[str, ...] = ()
    ) -> Scene:
        listener, limits = lab.specification().numeric.listener, lab.limits().listener
        single = self._single(listener, build, installed, remappings)
        assert single is not None
        how, label, request = single
        numbers = tuple(self._random.sample(range(-128, 128), 1 + limits.numbers + limits.paced))
        texts = tuple(" ".join(self._random.sample(WORDS, 3)) for _ in range(limits.texts + 1))
        plan = ScenePlan(SceneName.LISTENER, Clock.REAL_TIME, request, label, numbers=numbers, texts=texts)
        return self._play(plan, how, started)

    def _play(self, plan: ScenePlan, started_with: str, started: threading.Event) -> Scene:
        try:
            observer = self._waiting.pop()
        except IndexError:
            observer = self._observer()
        return observer.play(plan, started_with, self._writer.scene_path(plan.scene), started)

    # --- what is started --------------------------------------------------------------------

    def _prefix(self, installed: Path) -> str:
        root = INSTALLED if self._isolation.on else str(installed / "install")
        return f"{root}/{lab.specification().package}"

    def _single(
        self, name: str, build: Build, installed: Path, arguments: tuple[str, ...] = ()
    ) -> tuple[str, str, Request] | None:
        """How to start *name* by itself: (`executable` or `module`, its name, the request); None when there is nothing.

        Args:
            name: Of the worksheet's program.
            build: What was built.
            installed: Where it was unpacked.
            arguments: What follows `--ros-args`.
        """
        package = lab.specification().package
        ros_arguments = ("--ros-args", *arguments) if arguments else ()
        how, found = program(name, build, without_function(build, installed))
        if how == "executable":
            path = f"{self._prefix(installed)}/lib/{package}/{found}"
            return how, found, self._confined((path, *ros_arguments), installed)
        if how == "module":
            argv = (process.PYTHON, "-c", RUN_MODULE, f"{package}.{found}", *ros_arguments)
            return how, found, self._confined(argv, installed)
        return None

    def _confined(self, argv: tuple[str, ...], installed: Path) -> Request:
        home = sandbox.HOME if self._isolation.on else str(self._home)
        conversation, resources = lab.limits().conversation, lab.limits().resources
        seconds = conversation.realtime_seconds + conversation.timelapse_seconds
        request = Request(
            argv=argv,
            env=self._ros.environment(home, self._prefix(installed)),
            cwd=home,
            limits=resources.limits(seconds),
        )
        mounts = (
            sandbox.Mount(str(installed / "install"), INSTALLED),
            *(sandbox.Mount(path) for path in self._ros.reads()),
        )
        return sandbox.confine(request, mounts, self._isolation, needs=self._ros.launcher)


def entry(scene: Scene) -> SceneEntry:
    """What the manifest says of *scene*."""
    return SceneEntry(
        scene.name, scene.started_with, scene.label, scene.clock, scene.complete, scene.fault, scene.seconds
    )


def _launch_path(build: Build, name: str) -> str:
    """Where the launch file *name* was installed below the package's share directory; empty when it was not.

    Like `ros2 launch`, which looks through the whole share directory; of several the first is taken here, and the
    launch itself then says that it is ambiguous.
    """
    return next((path for path in build.launch_files if path.rsplit("/", 1)[-1] == name), "")


def _died_silent(scene: Scene) -> bool:
    """Whether the program of *scene*, which the grader's clock had given arguments, ended before it had published anything."""
    ended = any(isinstance(event, ProcessGone) and event.by is EndedBy.ITSELF for event in scene.events)
    spoke = any(isinstance(event, Message) for event in scene.events)
    return scene.clock is Clock.TIME_LAPSE and ended and not spoke


def _makes_publishers(scene: Scene) -> bool:
    """Whether a node of *scene* made publishers of the numbers again and again while the grader drove its clock.

    Messages of different publishers overtake each other when they follow each other so fast; in real time they do not.
    """
    topic = lab.specification().number_topic.name
    made = (
        event
        for event in scene.events
        if isinstance(event, Endpoint) and (event.kind, event.topic, event.event) == ("publisher", topic, "appeared")
    )
    return scene.clock is Clock.TIME_LAPSE and renews_publisher(made)


def _shows_talker(scene: Scene, talker: str) -> bool:
    """Whether the launch let the *talker* be judged: it ran, spoke, and nobody else spoke on either topic.

    Who spoke is told by the process that a publisher belongs to, not by the name that its node gives itself.
    """
    specification = lab.specification()
    topics = (specification.number_topic.name, specification.text_topic.name)
    started = any(isinstance(event, ProcessSeen) and event.executable == talker for event in scene.events)
    speakers = [
        event
        for event in scene.events
        if isinstance(event, Endpoint)
        and event.event == "appeared"
        and event.kind == "publisher"
        and event.topic in topics
    ]
    heard = any(isinstance(event, Message) and event.topic == topics[0] for event in scene.events)
    alone = len({event.node for event in speakers}) == 1 and len(speakers) <= len(topics)
    return started and heard and alone and all(event.program in (talker, "") for event in speakers)


def _remappings_that_help(scenes: Mapping[SceneName, Scene], listener: str) -> tuple[str, ...]:
    """The remappings (`-r from:=to …`) with which the launch brings the *listener* to the topics; empty for none needed.

    A listener that speaks of another topic, which its launch file remaps to the right one, is right (VERDICTS). By itself
    it would miss what is sent, so it is listened to again as the launch starts it. Where the launch gave it the name in
    another way (a parameter), the topic that it has by itself instead is remapped.
    """
    alone, together = scenes.get(SceneName.LISTENER), scenes.get(SceneName.CONVERSATION)
    if alone is None or together is None:
        return ()
    here, there = _subscribed(alone), _subscribed(together)
    topics = (lab.specification().number_topic, lab.specification().text_topic)
    missed = [topic for topic in topics if topic.name in there and topic.name not in here]
    if not missed:
        return ()
    commands = (e.command for e in together.events if isinstance(e, ProcessSeen) and e.executable == listener)
    found = REMAPPING.findall(next(commands, ""))
    if all(remapping.startswith("__") for remapping in found):  # the names of the node and its namespace
        instead = {topic.name: [name for name in here if here[name] == topic.type] for topic in missed}
        found += [f"{names[0]}:={topic}" for topic, names in instead.items() if len(names) == 1]
    return tuple(word for remapping in found for word in ("-r", remapping))


def _subscribed(scene: Scene) -> dict[str, str]:
    """The topics that were subscribed to, with their types."""
    return {
        event.topic: event.type
        for event in scene.events
        if isinstance(event, Endpoint) and event.kind == "subscription"
    }
