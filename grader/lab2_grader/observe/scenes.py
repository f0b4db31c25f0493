"""The scripts of the scenes: what the observer does in each, and when it has seen enough."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

from lab2_grader import lab
from lab2_grader.observe.clock import LockStep
from lab2_grader.observe.observer import Observer, message_class
from lab2_grader.reading import NUMBER, numbers_in, said
from lab2_grader.records import Clock, Measured, Message, Phase, SceneName, ScenePlan, Sent

NO_NODE_SECONDS = 8.0  # a program that has done nothing for so long, and is no node yet, will not become one
WARM_UP_TRIES = 4
WARM_UP_SECONDS = 0.5
PARTIAL_LINE_SECONDS = 0.2
NUDGE_SECONDS = 0.05
PATIENCE = 2  # after so many answers that did not come, the next are waited for only while there is work going on
MATCH_SECONDS = 3.0  # from a subscription in the graph to one that is matched; one that asks for more never is
BRIEF_SECONDS = 0.15  # without any work
LAST_WORD_SECONDS = 0.3  # after what was sent last, nothing happened for so long
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
        """Everything that runs is in the graph, and nothing has happened for a while."""
        running = 1 if plan.label else len(observer.executables())
        present = 0 < running <= len(observer.nodes())
        return observer.quiet_seconds > (limits.settle_seconds if present else NO_NODE_SECONDS)

    observer.until(lambda: complete() or settled() or not observer.alive(), limits.seconds)
    if complete():
        observer.recorder.write(Measured(observer.recorder.now(), "graph_seconds", round(time.monotonic() - began, 3)))
    _phase(observer, "graph")


class _Ear:
    """Waits for what *source* prints, patiently at first, and no longer than it works once it has proved to be deaf."""

    def __init__(self, observer: Observer, source: str, seconds: float) -> None:
        self._observer = observer
        self._source = source
        self._seconds = seconds
        self._misses = 0

    def hears(
        self,
        fits: Callable[[str], bool],
        since: int,
        seconds: float | None = None,
        nudge: Callable[[], bool] = lambda: False,
    ) -> bool:
        """Whether a line after the first *since* fits, now or soon (within *seconds*, which then proves nothing).

        When nothing fits at once, *nudge* is called until something does, or it says that it can do no more.
        """
        lines = self._observer.lines

        def heard() -> bool:
            return any(line.source in (self._source, "ros2") and fits(line.text) for line in lines[since:])

        patience, began = seconds or self._seconds, time.monotonic()

        def over() -> bool:
            idle = min(self._observer.quiet_seconds, time.monotonic() - began)
            deaf = seconds is None and self._misses >= PATIENCE
            gone = self._source in self._observer.ended_executables - self._observer.executables()
            return heard() or ((deaf or gone) and idle > BRIEF_SECONDS) or not self._observer.alive()

        if not self._observer.until(heard, min(patience, PARTIAL_LINE_SECONDS)):
            self._observer.finish_lines()
            while self._misses < PATIENCE and nudge() and not self._observer.until(heard, NUDGE_SECONDS):
                pass
            self._observer.until(over, patience)
        found = heard()
        if seconds is None:
            self._misses += not found
        return found


def _conversation(observer: Observer, plan: ScenePlan) -> None:
    """The launched pair: its graph, a slow dozen of ticks with the listener's answers, then the wraps at full speed."""
    specification, limits = lab.specification(), lab.limits().conversation
    topics = (specification.number_topic, specification.text_topic)
    for topic in topics:
        observer.listen(topic.name, topic.type)
    steps = LockStep(observer, plan.clock, plan.talker, plan.listener)
    wanted = frozenset((kind, topic.name) for kind in ("publisher", "subscription") for topic in topics)
    _start(observer, plan, wanted)
    if plan.clock is Clock.TIME_LAPSE:
        observer.until(lambda: steps.followers() >= len(observer.nodes()), lab.limits().start.settle_seconds)
    ear = _Ear(observer, plan.listener, limits.answer_seconds)

    def answer(message: Message) -> bool:
        number = message.data
        if not isinstance(number, int):
            return False
        since = max(0, len(observer.lines) - RECENT)
        heard = {str(m.data) for m in observer.messages[-RECENT:] if m.topic == specification.text_topic.name}
        # The text that goes with this number may be printed before it is heard here: it is taken to look like the others.
        greetings = heard | {NUMBER.sub(str(number), text) for text in heard}
        return ear.hears(lambda line: number in numbers_in(line, greetings), since, nudge=steps.nudge)

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


class _Post:
    """Sends to one topic what was made up, and waits for each to be printed.

    The first messages may be lost while the two sides still discover each other. So the first that was made up is sent
    until it is answered, a few times at most; what follows the phase `send <topic>` counts. Where nobody subscribes in a
    way that fits, nothing is sent.
    """

    def __init__(self, observer: Observer, topic: str, type_name: str, data: tuple[int | str, ...], ear: _Ear) -> None:
        self._observer = observer
        self._topic = topic
        self._type_name = type_name
        self._type = message_class(type_name)
        self._publisher = observer.publisher(topic, type_name)
        self._warm_up, *self._pending = data
        self._ear = ear
        self.waits: list[float] = []  # for each answer, in seconds

    def prepare(self) -> None:
        """Find the subscription and warm up; without one, or when the listener ends over it, nothing is pending."""

        def matched() -> bool:
            return bool(self._publisher.get_subscription_count())

        if self._subscribed():
            self._observer.until(lambda: matched() or not self._observer.alive(), MATCH_SECONDS)
        if not matched():
            self._pending.clear()
        for _ in range(WARM_UP_TRIES if self.pending else 0):
            if self._send(self._warm_up, WARM_UP_SECONDS) or not self._observer.alive():
                break
        _phase(self._observer, f"send {self._topic}")

    def _subscribed(self) -> bool:
        wanted = ("subscription", self._topic, self._type_name)
        return any((found.kind, found.topic, found.type) == wanted for found in self._observer.endpoints.values())

    @property
    def pending(self) -> int:
        """How many are still to be sent."""
        return len(self._pending) if self._observer.alive() else 0

    def send_next(self) -> None:
        """Send one and wait for the answer."""
        began = time.monotonic()
        if self._send(self._pending.pop(0)):
            self.waits.append(time.monotonic() - began)

    def send_at_pace(self, data: tuple[int | str, ...], seconds: float) -> None:
        """Send *data*, so many *seconds* apart, answered or not, and then wait for the answers.

        A machine that keeps the listener waiting is given more time, so that a queue for one message is enough.
        """
        since = len(self._observer.lines)
        for one in data:
            self._publish(one)
            due = time.monotonic() + seconds

            def taken(due: float = due) -> bool:
                waited = time.monotonic() >= due and self._observer.quiet_seconds > BRIEF_SECONDS
                return waited or not self._observer.alive()

            self._observer.until(taken, WARM_UP_TRIES * seconds)
        for one in data:
            self._ear.hears(_prints(one), since)

    def _publish(self, data: int | str) -> None:
        assert self._type is not None
        self._publisher.publish(self._type(data=data))
        self._observer.recorder.write(Sent(self._observer.recorder.now(), self._topic, data))

    def _send(self, data: int | str, seconds: float | None = None) -> bool:
        since = len(self._observer.lines)
        self._publish(data)
        return self._ear.hears(_prints(data), since, seconds)


def _listener(observer: Observer, plan: ScenePlan) -> None:
    """The listener by itself: the grader publishes what it made up and waits for each to be printed.

    Texts come first, so that a listener that falls over the first number has still shown what it does with them. One that
    answers late may print the last number now and then instead of each: further numbers do not wait for its answers.
    """
    specification, limits = lab.specification(), lab.limits().listener
    number_topic, text_topic = specification.number_topic, specification.text_topic

    def ear() -> _Ear:
        return _Ear(observer, plan.label, limits.answer_seconds)

    one_by_one, at_pace = plan.numbers[: limits.numbers + 1], plan.numbers[limits.numbers + 1 :]
    numbers = _Post(observer, number_topic.name, number_topic.type, one_by_one, ear())
    texts = _Post(observer, text_topic.name, text_topic.type, plan.texts, ear())
    wanted = frozenset(("subscription", topic.name) for topic in (number_topic, text_topic))
    _start(observer, plan, wanted)
    texts.prepare()
    for _ in range(texts.pending // 2):
        texts.send_next()
    numbers.prepare()
    every = max(1, numbers.pending // max(1, texts.pending))
    while numbers.pending:
        numbers.send_next()
        if numbers.pending % every == 0 and texts.pending:
            texts.send_next()
    while texts.pending:
        texts.send_next()
    period = text_topic.period_seconds
    if numbers.waits and statistics.median(numbers.waits) > period / 2 and observer.alive():
        _phase(observer, "pace")
        numbers.send_at_pace(at_pace, period)
    # What is printed late counts too, however slow the machine is.
    observer.until(lambda: observer.quiet_seconds > LAST_WORD_SECONDS or not observer.alive(), limits.answer_seconds)


def _prints(data: int | str) -> Callable[[str], bool]:
    if isinstance(data, int):
        return lambda line: data in numbers_in(line)
    return lambda line: data in said(line)


def _originals(observer: Observer, plan: ScenePlan) -> None:
    """`chatter.py` in real time, until enough greetings were heard and printed."""
    specification, limits = lab.specification(), lab.limits().originals
    topic = specification.text_topic
    observer.listen(topic.name, topic.type)
    wanted = frozenset((kind, topic.name) for kind in ("publisher", "subscription"))
    _start(observer, plan, wanted)

    def enough() -> bool:
        heard = [str(message.data) for message in observer.messages if message.topic == topic.name]
        printed = [line.text for line in observer.lines if line.source == plan.listener]
        answered = sum(any(text in line for line in printed) for text in set(heard[:RECENT]))
        return answered >= limits.messages

    observer.until(lambda: enough() or not observer.alive(), limits.seconds)
