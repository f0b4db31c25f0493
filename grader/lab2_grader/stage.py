"""Plays the scenes of one submission: which, with what, side by side, each observed by a process of its own.

Observers take longer to start than to observe, so they are started while the submission is still being built and wait
for their plan. What they say goes to the evidence file as it comes.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec

from lab2_grader import lab, process, sandbox
from lab2_grader.evidence import SceneEntry, Writer, events
from lab2_grader.near import nearest
from lab2_grader.records import (
    Build,
    Clock,
    EndedBy,
    Endpoint,
    Limits,
    Message,
    ProcessSeen,
    Request,
    Scene,
    SceneName,
    ScenePlan,
)
from lab2_grader.ros import Ros
from lab2_grader.ros.domains import Domain

INSTALLED = f"{sandbox.WORKSPACE}/install"
OBSERVER_OUTPUT_BYTES = 40_000_000
OBSERVER_GRACE_SECONDS = 30.0
EARLY_OBSERVERS = 3  # conversation, listener, originals: what a normal submission needs
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
        environment["PYTHONPATH"] = ":".join(filter(None, (here, environment.get("PYTHONPATH", ""))))
        conversation = lab.limits().conversation
        seconds = conversation.realtime_seconds + conversation.timelapse_seconds + OBSERVER_GRACE_SECONDS
        request = Request(
            argv=(sys.executable, "-m", "lab2_grader.observe"),
            env=tuple(environment.items()),
            cwd="/",
            limits=Limits(seconds=seconds, output_bytes=OBSERVER_OUTPUT_BYTES),
        )
        self._process = process.Process(sandbox.private_network(request, isolation), self._on_output, keep_stdin=True)

    def _on_output(self, stream: str, data: bytes) -> None:
        if stream == "stderr":
            self._errors += data[: max(0, 20_000 - len(self._errors))]
        elif self._sink is not None:
            self._sink(data)

    def play(self, plan: ScenePlan, started_with: str, path: Path) -> Scene:
        """Play *plan*, writing what is observed to *path*, and return it."""
        began = time.monotonic()
        with path.open("wb", buffering=0) as file:
            self._sink = file.write
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
        self._waiting = [self._observer() for _ in range(EARLY_OBSERVERS)]

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

        Args:
            build: What was built.
            installed: Where it was unpacked: the folder that holds `install/`.

        Raises:
            FaultError: An observer could not be started.
        """
        specification = lab.specification()
        numeric, original = specification.numeric, specification.original
        jobs: list[Callable[[], tuple[Scene, ...]]] = []
        if self._single(numeric.listener, build, installed) is not None:
            observer = self._waiting.pop()
            jobs.append(lambda: (self._listener(observer, build, installed),))
        if _launch_path(build, original.launch_file):
            second = self._waiting.pop()
            jobs.append(lambda: (self._launched(SceneName.ORIGINALS, second, build, installed, original.launch_file),))
        jobs.insert(0, lambda: self._conversation_and_talker(build, installed))
        with ThreadPoolExecutor(max_workers=len(jobs)) as pool:
            futures: list[Future[tuple[Scene, ...]]] = [pool.submit(job) for job in jobs]
            try:
                scenes = [scene for future in futures for scene in future.result()]
            except BaseException:
                self._dismiss_all()
                raise
        order = list(SceneName)
        return tuple(sorted(scenes, key=lambda scene: order.index(scene.name)))

    # --- one scene each ---------------------------------------------------------------------

    def _conversation_and_talker(self, build: Build, installed: Path) -> tuple[Scene, ...]:
        scenes: tuple[Scene, ...] = ()
        numeric = lab.specification().numeric
        if _launch_path(build, numeric.launch_file):
            observer = self._waiting.pop(0) if self._waiting else self._observer()
            scenes = (self._launched(SceneName.CONVERSATION, observer, build, installed, numeric.launch_file),)
            if _shows_talker(scenes[0]):
                return scenes
        single = self._single(numeric.talker, build, installed, follow=self._clock is Clock.TIME_LAPSE)
        if single is None:
            return scenes
        how, label, request = single
        plan = ScenePlan(SceneName.TALKER, self._clock, request, label)
        observer = self._waiting.pop(0) if self._waiting else self._observer()
        return (*scenes, observer.play(plan, how, self._writer.scene_path(plan.scene)))

    def _launched(self, name: SceneName, observer: _Observer, build: Build, installed: Path, launch_file: str) -> Scene:
        clock = self._clock if name is SceneName.CONVERSATION else Clock.REAL_TIME
        package = lab.specification().package
        path = f"{self._prefix(installed)}/share/{package}/{_launch_path(build, launch_file)}"
        argv = self._ros.launch_argv(package, launch_file, path, clock is Clock.TIME_LAPSE)
        plan = ScenePlan(name, clock, self._confined(argv, installed), "")
        return observer.play(plan, "launch", self._writer.scene_path(name))

    def _listener(self, observer: _Observer, build: Build, installed: Path) -> Scene:
        listener, limits = lab.specification().numeric.listener, lab.limits().listener
        single = self._single(listener, build, installed)
        assert single is not None
        how, label, request = single
        numbers = self._random.sample(range(-128, 128), limits.numbers + 1)
        texts = [" ".join(self._random.sample(WORDS, 3)) for _ in range(limits.texts + 1)]
        plan = ScenePlan(SceneName.LISTENER, Clock.REAL_TIME, request, label, tuple(numbers), tuple(texts))
        return observer.play(plan, how, self._writer.scene_path(plan.scene))

    # --- what is started --------------------------------------------------------------------

    def _prefix(self, installed: Path) -> str:
        root = INSTALLED if self._isolation.on else str(installed / "install")
        return f"{root}/{lab.specification().package}"

    def _single(
        self, name: str, build: Build, installed: Path, follow: bool = False
    ) -> tuple[str, str, Request] | None:
        """How to start *name* by itself: (`executable` or `module`, its name, the request); None when there is nothing.

        Failing the executable the module of that name, failing that the one whose name comes nearest: a missing entry
        point or a misspelt file costs its own marks and no others.
        """
        package, specification = lab.specification().package, lab.specification()
        ros_arguments = ("--ros-args", "-p", "use_sim_time:=true") if follow else ()
        pairs = (specification.original, specification.numeric)
        taken = {program for pair in pairs for program in (pair.talker, pair.listener)}
        executables = [found for found in build.executables if found not in build.dangling]
        candidates = (
            ("executable", name if name in executables else ""),
            ("module", name if name in build.modules else ""),
            ("executable", nearest(name, executables, taken)),
            ("module", nearest(name, build.modules, taken)),
        )
        how, found = next((candidate for candidate in candidates if candidate[1]), ("", ""))
        if how == "executable":
            program = f"{self._prefix(installed)}/lib/{package}/{found}"
            return how, found, self._confined((program, *ros_arguments), installed)
        if how == "module":
            argv = (sys.executable, "-c", RUN_MODULE, f"{package}.{found}", *ros_arguments)
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
        return sandbox.confine(request, mounts, self._isolation)


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


def _shows_talker(scene: Scene) -> bool:
    """Whether the launch let the talker be judged: it ran, spoke, and nobody else spoke on either topic."""
    specification = lab.specification()
    topics = (specification.number_topic.name, specification.text_topic.name)
    talker = specification.numeric.talker
    started = any(isinstance(event, ProcessSeen) and event.executable == talker for event in scene.events)
    speakers = [
        (event.node, event.topic)
        for event in scene.events
        if isinstance(event, Endpoint)
        and event.event == "appeared"
        and event.kind == "publisher"
        and event.topic in topics
    ]
    heard = any(isinstance(event, Message) and event.topic == topics[0] for event in scene.events)
    return started and heard and len({node for node, _ in speakers}) == 1 and len(speakers) <= len(topics)
