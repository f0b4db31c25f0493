"""The scripts of the scenes: what the observer does in each, and when it has seen enough."""

from __future__ import annotations

import time
from collections.abc import Callable

from lab2_grader import lab
from lab2_grader.observe.clock import LockStep
from lab2_grader.observe.observer import Observer
from lab2_grader.reading import numbers_in, said
from lab2_grader.records import Clock, Measured, Message, Phase, SceneName, ScenePlan, Sent

NO_PROCESS_SECONDS = 8.0  # a launch that has started none of the package's executables by then will not
BUSY_PATIENCE = 5
WARM_UP_TRIES = 4
WARM_UP_SECONDS = 0.5
PARTIAL_LINE_SECONDS = 0.2
PATIENCE = 2  # after so many answers in a row that did not come, the next are waited for only briefly
BRIEF_SECONDS = 0.3
RECENT = 20  # lines and messages back that can belong to the tick that was just made


def play(observer: Observer, plan: ScenePlan) -> None:
    """Play *plan* to its end, whatever the submission does."""
    {
        SceneName.CONVERSATION: _conversation,
        SceneName.LISTENER: _listener,
        SceneName.TALKER: _talker,
        SceneName.ORIGINALS: _originals,
    }[plan.scene](observer, plan)
    _phase(observer, "stop")
    observer.look_at_graph()
    observer.stop()


def _phase(observer: Observer, name: str) -> None:
    observer.recorder.write(Phase(observer.recorder.now(), name))


def _start(observer: Observer, plan: ScenePlan, wanted: frozenset[tuple[str, str]]) -> None:
    """Start the program and wait until the graph has every endpoint of *wanted*, or will not get any further.

    Args:
        observer: Watches.
        plan: What is to be started.
        wanted: (kind, topic) of the endpoints that a complete graph has.
    """
    limits = lab.limits().start
    observer.start(plan.program, plan.label)
    _phase(observer, "start")
    began = time.monotonic()

    def complete() -> bool:
        return wanted <= {(endpoint.kind, endpoint.topic) for endpoint in observer.endpoints.values()}

    def settled() -> bool:
        """Everything that runs is in the graph and waits, and the graph has not changed for a while.

        A process that wants the processor may still be starting on a busy machine; one that always wants it is given
        a few times as long.
        """
        now = observer.recorder.now()
        since_change, since_busy = now - observer.graph_changed_at, now - observer.busy_at
        if (
            min(since_change, since_busy) < limits.settle_seconds
            and since_change < BUSY_PATIENCE * limits.settle_seconds
        ):
            return False
        running = len(observer.executables()) if not plan.label else 1
        if running == 0:
            return time.monotonic() - began > NO_PROCESS_SECONDS
        return len(observer.nodes) >= running

    observer.until(lambda: complete() or settled() or not observer.alive(), limits.seconds)
    if complete():
        observer.recorder.write(Measured(observer.recorder.now(), "graph_seconds", round(time.monotonic() - began, 3)))
    _phase(observer, "graph")


class _Ear:
    """Waits for what *source* prints, patiently at first and briefly once it has proved to be deaf."""

    def __init__(self, observer: Observer, source: str, seconds: float) -> None:
        self._observer = observer
        self._source = source
        self._seconds = seconds
        self._misses = 0

    def hears(self, fits: Callable[[str], bool], since: int) -> bool:
        """Whether a line after the first *since* fits, now or soon."""
        lines = self._observer.lines

        def heard() -> bool:
            return any(line.source == self._source and fits(line.text) for line in lines[since:])

        patience = self._seconds if self._misses < PATIENCE else BRIEF_SECONDS
        if not self._observer.until(heard, min(patience, PARTIAL_LINE_SECONDS)):
            self._observer.finish_lines()
            self._observer.until(lambda: heard() or not self._observer.alive(), patience)
        found = heard()
        self._misses = 0 if found else self._misses + 1
        return found


def _conversation(observer: Observer, plan: ScenePlan) -> None:
    """The launched pair: its graph, a slow dozen of ticks with the listener's answers, then the wraps at full speed."""
    specification, limits = lab.specification(), lab.limits().conversation
    topics = (specification.number_topic, specification.text_topic)
    for topic in topics:
        observer.listen(topic.name, topic.type)
    steps = LockStep(observer, plan.clock, specification.numeric.talker)
    wanted = frozenset((kind, topic.name) for kind in ("publisher", "subscription") for topic in topics)
    _start(observer, plan, wanted)
    if plan.clock is Clock.TIME_LAPSE:
        observer.until(lambda: steps.followers() >= len(observer.nodes), lab.limits().start.settle_seconds)
    ear = _Ear(observer, specification.numeric.listener, limits.answer_seconds)

    def answer(message: Message) -> None:
        if isinstance(message.data, int):
            number = message.data
            since = max(0, len(observer.lines) - RECENT)
            greetings = [str(m.data) for m in observer.messages[-RECENT:] if m.topic == specification.text_topic.name]
            ear.hears(lambda line: number in numbers_in(line, greetings), since)

    if observer.alive():
        steps.play(_number_topic(observer), answer)


def _talker(observer: Observer, plan: ScenePlan) -> None:
    """The talker by itself: its ticks, without anybody who answers."""
    specification = lab.specification()
    topics = (specification.number_topic, specification.text_topic)
    for topic in topics:
        observer.listen(topic.name, topic.type)
    steps = LockStep(observer, plan.clock, plan.label)
    _start(observer, plan, frozenset(("publisher", topic.name) for topic in topics))
    if plan.clock is Clock.TIME_LAPSE:
        observer.until(lambda: steps.followers() >= 1, lab.limits().start.settle_seconds)
    if observer.alive():
        steps.play(_number_topic(observer), None)


def _number_topic(observer: Observer) -> str:
    """The topic asked for when somebody publishes there, else one that carries something else than text."""
    specification = lab.specification()
    wanted = specification.number_topic.name
    published = [endpoint for endpoint in observer.endpoints.values() if endpoint.kind == "publisher"]
    if any(endpoint.topic == wanted for endpoint in published):
        return wanted
    others = (endpoint.topic for endpoint in published if endpoint.type != specification.text_topic.type)
    return next(others, wanted)


def _listener(observer: Observer, plan: ScenePlan) -> None:
    """The listener by itself: the grader publishes what it made up and waits for each to be printed."""
    specification, limits = lab.specification(), lab.limits().listener
    number_topic, text_topic = specification.number_topic, specification.text_topic
    numbers = observer.publisher(number_topic.name, number_topic.type)
    texts = observer.publisher(text_topic.name, text_topic.type)
    wanted = frozenset(("subscription", topic.name) for topic in (number_topic, text_topic))
    _start(observer, plan, wanted)
    ears = {topic.name: _Ear(observer, plan.label, limits.answer_seconds) for topic in (number_topic, text_topic)}

    def send(publisher: object, topic: str, data: int | str, patience: float | None = None) -> bool:
        since = len(observer.lines)
        message = (Int8 if isinstance(data, int) else String)(data=data)
        publisher.publish(message)  # type: ignore[attr-defined]
        observer.recorder.write(Sent(observer.recorder.now(), topic, data))
        fits = _has_number(data) if isinstance(data, int) else _has_text(data)
        if patience is None:
            return ears[topic].hears(fits, since)
        return observer.until(lambda: any(fits(line.text) for line in observer.lines[since:]), patience)

    from std_msgs.msg import Int8, String

    # The first messages may be lost while the two sides still discover each other: these do not count.
    _phase(observer, "warm-up")
    for publisher, topic, data in (
        (numbers, number_topic.name, plan.numbers[0]),
        (texts, text_topic.name, plan.texts[0]),
    ):
        if publisher.get_subscription_count() and observer.alive():
            any(send(publisher, topic, data, WARM_UP_SECONDS) for _ in range(WARM_UP_TRIES))
    _phase(observer, "send")
    pending = list(plan.texts[1:])
    every = max(1, len(plan.numbers) // max(1, len(pending)))
    for index, number in enumerate(plan.numbers[1:]):
        if not observer.alive():
            break
        send(numbers, number_topic.name, number)
        if index % every == 0 and pending:
            send(texts, text_topic.name, pending.pop(0))
    for text in pending:
        if observer.alive():
            send(texts, text_topic.name, text)


def _has_number(number: int) -> Callable[[str], bool]:
    return lambda line: number in numbers_in(line)


def _has_text(text: str) -> Callable[[str], bool]:
    return lambda line: text in said(line)


def _originals(observer: Observer, plan: ScenePlan) -> None:
    """`chatter.py` in real time, until enough greetings were heard and printed."""
    specification, limits = lab.specification(), lab.limits().originals
    topic = specification.text_topic
    observer.listen(topic.name, topic.type)
    wanted = frozenset((kind, topic.name) for kind in ("publisher", "subscription"))
    _start(observer, plan, wanted)

    def enough() -> bool:
        heard = [str(message.data) for message in observer.messages if message.topic == topic.name]
        printed = [line.text for line in observer.lines if line.source == specification.original.listener]
        answered = sum(any(text in line for line in printed) for text in set(heard))
        return len(heard) >= limits.messages and answered >= limits.messages - 1

    observer.until(lambda: enough() or not observer.alive(), limits.seconds)
