"""The ROS clock in the grader's hand: moved in lock-step with what the talker publishes.

A timer of a node that follows the ROS clock fires once for each step that is at least its period long, however long
the machine takes to let it: the step waits for the message, not the message for the step. A node that does not follow
the ROS clock ticks while the clock stands still, and is then simply listened to in real time. Both ways record the
same sequence; only the time they take differs.
"""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Callable

from lab2_grader import lab
from lab2_grader.observe.observer import Observer
from lab2_grader.records import Clock, Measured, Message, Phase, Tick

FIRST_JUMP_SECONDS = 10.0
PROBE_SECONDS = 0.05  # ROS time moved at a time while the period is measured
PROBE_WAIT_SECONDS = (0.004, 0.05)  # at least and at most
PROBE_PATIENCE = 3  # times its best answer is what a probe waits
STEP_WAIT_SECONDS = 0.05
FIRST_WAIT_SECONDS = 1.0
HOLD_SECONDS = 0.1  # how long the clock stands still, at least, to see whether the node does too
UNASKED_LIMIT = 5  # so many messages while the clock stands still: the node has a clock of its own
TARDY_STEPS = 3  # a message that took more steps than this was not asked for by them
TARDY_LIMIT = 5
WINDOW = 10  # ticks
FAR = 0.15  # of what was measured
MESSAGES_A_TICK = 20  # at most
REAL_TIME_HERTZ = 20
HELD_SECONDS = 5.0  # a held node is let go before the middleware takes it for dead

OnNumber = Callable[[Message], bool]


class LockStep:
    """Plays the ticks of a talker.

    Args:
        observer: Hears what the talker publishes.
        clock: TIME_LAPSE to drive the ROS clock, REAL_TIME to leave it alone.
        talker: The executable that ticks; once it has ended there is nothing to wait for.
        listener: The executable that only listens, if there is one. Once it has answered all it was asked, it is held during
            the fast part under the ROS clock, which is about the talker alone and takes half as long without it.
    """

    def __init__(self, observer: Observer, clock: Clock, talker: str, listener: str = "") -> None:
        self._observer = observer
        self._talker = talker
        self._limits = lab.limits().conversation
        self._drives = clock is Clock.TIME_LAPSE
        self._follows = self._drives
        self._publisher = observer.publisher("/clock", "rosgraph_msgs/msg/Clock") if self._drives else None
        self._now = 0.0
        self._period = 0.0
        self._tardy = 0
        self._measured_anew = False
        self._advanced_at = 0.0
        self._ahead = 0.0  # of the last tick, in ROS time
        self._ticks: list[float] = []  # since the period was measured: the ROS time of each
        self._listener = listener
        self._hold = contextlib.ExitStack()

    def followers(self) -> int:
        """How many nodes listen to the clock."""
        return self._publisher.get_subscription_count() if self._publisher else 0

    def play(self, topic: str, on_slow: OnNumber | None) -> None:
        """Let the talker tick until its count must have wrapped, or it falls silent, or time is up.

        Args:
            topic: Where the numbers are expected.
            on_slow: Called with each number of the slow part, before the next tick, and says whether it was answered; None for
                no slow part.
        """
        answered = True
        number_topic = lab.specification().number_topic
        length = number_topic.largest - number_topic.smallest + 1
        self._topic = topic
        self._deadline = time.monotonic() + self._limits.timelapse_seconds
        if self._drives:
            self._phase("period")
            if not self._find_period():
                return
        if not self._follows:
            self._begin_real_time()
        if on_slow is not None:
            self._phase("slow")
            for _ in range(self._limits.slow_ticks):
                if not self._next_tick():
                    return
                numbers = self._heard()
                if numbers:
                    answered = on_slow(numbers[-1]) and answered
        self._phase("fast")
        held_until = time.monotonic() + HELD_SECONDS
        with self._hold:
            if self._follows and self._listener and answered:
                self._hold.enter_context(self._observer.held(self._listener))
            while self._next_tick():
                wanted = length * self._limits.wraps + length // 8 if self._follows else length + 4
                if len(self._heard()) >= wanted:
                    break
                if time.monotonic() > held_until:
                    self._hold.close()
        if self._follows:
            self._refine_period()

    def nudge(self) -> bool:
        """Move the clock by a tenth of a period, for other timers than the talker's may be waiting for that.

        False when it is half way to the next tick: further would be too far for a talker that was measured badly.
        """
        tenth = max(round(self._period / 10, 6), PROBE_SECONDS)
        if not self._follows or self._ahead + tenth > self._period / 2:
            return False
        self._advance(tenth)
        self._ahead += tenth
        return True

    # --- ticks ------------------------------------------------------------------------------

    def _heard(self) -> list[Message]:
        """The numbers so far; every message while there is no number, so that silence can be told from slowness."""
        return self._observer.messages_on(self._topic) or self._observer.messages

    def _next_tick(self) -> bool:
        """Move the clock until the talker speaks; False when it is silent, has ended, or time is up."""
        before = len(self._heard())
        began = time.monotonic()
        steps = 0
        while len(self._heard()) == before:
            now = time.monotonic()
            if now > self._deadline or now - began > self._silence() or not self._can_tick():
                return False
            if self._follows:
                self._advance(self._period - self._ahead)
                self._ahead = 0.0
                steps += 1
            self._wait(before, STEP_WAIT_SECONDS)
        if self._follows:
            self._ticks.append(self._now)
            self._tardy = self._tardy + 1 if steps > TARDY_STEPS else 0
            if self._tardy >= TARDY_LIMIT:
                return self._measure_anew()
        return True

    def _measure_anew(self) -> bool:
        """The numbers do not come as was measured: perhaps it was of other messages. The second time it is another clock's.

        False when the talker falls silent, or ends, over that.
        """
        self._tardy = 0
        found = self._measured_anew or self._find_period()
        if found and (self._measured_anew or not self._follows):
            self._begin_real_time()
        self._measured_anew = True
        return found

    def _can_tick(self) -> bool:
        """Whether there is still somebody who could tick."""
        return self._observer.alive() and self._talker not in self._observer.ended_executables

    def _silence(self) -> float:
        """How long the talker may be silent before it counts as having stopped."""
        return max(self._limits.silence_seconds, 2.5 * self._period if not self._follows else 0.0)

    def _wait(self, before: int, seconds: float) -> bool:
        """Wait for a message beyond the first *before*; in real time the clock goes on meanwhile."""
        deadline = time.monotonic() + seconds
        while len(self._heard()) == before:
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            if self._drives and not self._follows and time.monotonic() >= self._next_clock:
                self._advance(1 / REAL_TIME_HERTZ)
                self._next_clock += 1 / REAL_TIME_HERTZ
            self._observer.spin(min(left, 1 / REAL_TIME_HERTZ))
        return True

    def _advance(self, seconds: float) -> None:
        assert self._publisher is not None
        from rosgraph_msgs.msg import Clock as ClockMessage

        self._now = round(self._now + seconds, 6)
        message = ClockMessage()
        message.clock.sec = int(self._now)
        message.clock.nanosec = round((self._now - int(self._now)) * 1e9)
        self._publisher.publish(message)
        self._advanced_at = time.monotonic()
        self._observer.recorder.write(Tick(self._observer.recorder.now(), self._now))

    # --- the period, and whether the node follows -----------------------------------------

    def _find_period(self) -> bool:
        """Measure the period in ROS time, twice, and see whether the node stands still when the clock does.

        False when the talker falls silent, or ends, before that.
        """
        self._ahead = 0.0
        self._jump()
        shortest, longest = PROBE_WAIT_SECONDS
        answer = longest  # how soon the talker answers, at its best
        intervals: list[int] = []
        took = 0.0
        for _ in range(3):
            before, began, probes = len(self._heard()), time.monotonic(), 0
            answer = min(answer, began - self._advanced_at)
            patience = min(max(PROBE_PATIENCE * answer, shortest), longest)
            if intervals and intervals[-1] > 1:  # nothing is expected before the last probe of the last interval
                probes = intervals[-1] - 1
                self._advance(probes * PROBE_SECONDS)
                self._wait(before, patience)
            while len(self._heard()) == before:
                if time.monotonic() - began > self._limits.silence_seconds or not self._can_tick():
                    return False
                self._advance(PROBE_SECONDS)
                probes += 1
                self._wait(before, patience)
            intervals.append(probes)
            took = time.monotonic() - began
        # The interval after the first jump may be short of a whole period, so it does not count. A late answer makes one look
        # longer, and the next one shorter. A step that is too long would let a timer fire twice, one that is too short only
        # not at all; what most tens of ticks say is the period then.
        self._period = round(min(intervals[1:]) * PROBE_SECONDS, 6)
        self._follows = self._stands_still(max(HOLD_SECONDS, 1.5 * took))
        if self._follows and self._period != lab.specification().text_topic.period_seconds:
            self._shorten()
        self._record("follows_ros_clock", float(self._follows))
        self._record("period_seconds", self._period if self._follows else round(took, 2))
        self._ticks = []
        return True

    def _settle(self, seconds: float) -> None:
        """Let what belongs to the same tick come."""
        for _ in range(MESSAGES_A_TICK):
            if not self._wait(len(self._heard()), seconds):
                return

    def _jump(self) -> None:
        """Move the clock far enough for any timer, and wait for the first message.

        The publisher sees that a node listens a moment before the node hears it, so the same time is said again and again.
        """
        before, deadline = len(self._heard()), time.monotonic() + FIRST_WAIT_SECONDS
        self._advance(FIRST_JUMP_SECONDS)
        while not self._wait(before, STEP_WAIT_SECONDS) and time.monotonic() < deadline and self._can_tick():
            self._advance(0)

    def _stands_still(self, seconds: float) -> bool:
        """Whether nothing comes for *seconds* while the clock does not move; a few late messages are let pass."""
        return any(not self._wait(len(self._heard()), seconds) for _ in range(UNASKED_LIMIT))

    def _shorten(self) -> None:
        """Shorten the period for as long as messages come before it is over; late answers can have made it look longer.

        One may come early because the one before came late, so it takes two in a row.
        """
        early = 0
        while self._period > PROBE_SECONDS and not self._ahead:
            if self._comes_early(HOLD_SECONDS):
                early, self._ahead = early + 1, 0.0
                self._settle(STEP_WAIT_SECONDS)
            if early == 2:
                probes = round(self._period / PROBE_SECONDS)
                self._period = round((probes - max(1, probes // 10)) * PROBE_SECONDS, 6)
                early = 0

    def _comes_early(self, seconds: float) -> bool:
        """Whether a message comes, within *seconds*, when the clock has moved a little less than the period."""
        before, self._ahead = len(self._heard()), round(self._period - PROBE_SECONDS, 6)
        self._advance(self._ahead)
        return self._wait(before, seconds)

    def _refine_period(self) -> None:
        """Record what most tens of ticks say instead; 0, which says nothing, when that is far from what was measured.

        A step that is a little short is missed by one tick in ten, and a busy machine lets a tick slip now and then. A step
        that is too long is answered each time, but so is a shorter one.
        """
        ticks = self._ticks
        if len(ticks) <= 2 * WINDOW:
            return
        spans = (after - before for before, after in zip(ticks, ticks[WINDOW:], strict=False))
        period = round(statistics.median(spans) / WINDOW / PROBE_SECONDS) * PROBE_SECONDS
        agrees = abs(period - self._period) <= max(FAR * self._period, PROBE_SECONDS / 2)
        if agrees and self._period > PROBE_SECONDS:
            agrees = not self._comes_early(STEP_WAIT_SECONDS)
        self._record("period_seconds", round(period, 2) if agrees else 0.0)

    def _begin_real_time(self) -> None:
        self._phase("real-time")
        if self._follows:
            self._record("follows_ros_clock", 0.0)
        self._hold.close()
        self._follows = False
        self._deadline = time.monotonic() + self._limits.realtime_seconds
        self._next_clock = time.monotonic()

    def _phase(self, name: str) -> None:
        self._observer.recorder.write(Phase(self._observer.recorder.now(), name))

    def _record(self, name: str, value: float) -> None:
        self._observer.recorder.write(Measured(self._observer.recorder.now(), name, value))
