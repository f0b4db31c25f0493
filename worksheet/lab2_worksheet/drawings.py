"""The worksheet's pictures, drawn with the code that the reports use too."""

from __future__ import annotations

from collections.abc import Callable

from lab2_grader import lab
from lab2_grader.report.pictures import (
    GraphEdge,
    GraphNode,
    GraphTopic,
    Mark,
    Strip,
    Value,
    graph_svg,
    sequence_svg,
    strip_svg,
)

INT8_LARGEST = 127  # of std_msgs/msg/Int8, whatever the lab's own largest number
INT8_SMALLEST = -128


def publish_subscribe() -> str:
    """A publisher, a topic and two subscribers that know nothing of one another."""
    return graph_svg(
        [
            GraphNode("p", "publisher", "calls publish(message)"),
            GraphNode("s", "subscriber", "its callback(message) runs"),
            GraphNode("t", "another subscriber", "gets a copy too"),
        ],
        [GraphTopic("c", "topic", note="a name and a type")],
        [GraphEdge("p", "c", True), GraphEdge("s", "c", False), GraphEdge("t", "c", False)],
        id_prefix="picture-publish-subscribe",
        title="Publisher, topic, subscribers",
        desc="A publisher sends each message to a topic, which has a name and a type. Every subscriber of that topic "
        "gets a copy: its callback runs. Publisher and subscribers do not know one another; they share the topic only.",
    )


def chatter() -> str:
    """The graph of the launched originals."""
    text = lab.specification().text_topic
    return graph_svg(
        [GraphNode("t", "/my_talker", "publisher"), GraphNode("l", "/my_listener", "subscriber")],
        [GraphTopic("c", text.name, text.type)],
        [GraphEdge("t", "c", True), GraphEdge("l", "c", False)],
        id_prefix="picture-chatter",
        title="The ROS graph of the talker and the listener",
    )


def numeric_chatter() -> str:
    """The graph that the exercise asks for."""
    spec = lab.specification()
    return graph_svg(
        [
            GraphNode("t", "your numeric talker", "two publishers"),
            GraphNode("l", "your numeric listener", "two subscriptions"),
        ],
        [
            GraphTopic("c", spec.text_topic.name, spec.text_topic.type),
            GraphTopic("n", spec.number_topic.name, spec.number_topic.type),
        ],
        [
            GraphEdge("t", "c", True),
            GraphEdge("t", "n", True),
            GraphEdge("l", "c", False),
            GraphEdge("l", "n", False),
        ],
        id_prefix="picture-numeric-chatter",
        title="The ROS graph that the exercise asks for",
    )


def count() -> str:
    """The saw-tooth: two and a half rounds of the count."""
    topic = lab.specification().number_topic
    values = [*range(topic.smallest, topic.largest + 1)] * 2
    values += values[: len(values) // 4]
    return sequence_svg(
        values,
        values,
        id_prefix="picture-count",
        title=f"The count on {topic.name}",
        desc=f"The count climbs by one from {topic.smallest} to {topic.largest}, drops to {topic.smallest}, and climbs "
        "again: a saw-tooth.",
        width=420,
        height=190,
        key=False,
    )


def around_the_reset() -> str:
    """What comes around the largest number when all is well, and what the two usual mistakes send."""
    topic = lab.specification().number_topic
    low, high = topic.smallest, topic.largest

    def right(*values: int) -> tuple[Value, ...]:
        return tuple(Value(_minus(value)) for value in values)

    def wrong(*values: int) -> tuple[Value, ...]:
        return tuple(Value(_minus(value), Mark.WRONG) for value in values)

    return strip_svg(
        [
            Strip("Asked for", right(high - 2, high - 1, high, low, low + 1), mark=Mark.OK),
            Strip("Accepted too", right(high - 2, high - 1, low, low + 1, low + 2), f"without {high}", Mark.OK),
            Strip(
                "No reset",
                right(high - 1, high) + wrong(*_past(high)),
                "Int8 rolls over, silently",
                Mark.WRONG,
            ),
            Strip(
                "Reset to the wrong number", right(high - 2, high - 1, high) + wrong(low + 1, low + 2), "", Mark.WRONG
            ),
        ],
        id_prefix="picture-reset",
        title=f"The numbers around {high}",
    )


def _past(high: int) -> tuple[int, ...]:
    """The three values that an Int8 holds after *high* when nothing resets it."""
    span = INT8_LARGEST - INT8_SMALLEST + 1
    return tuple((high + step - INT8_SMALLEST) % span + INT8_SMALLEST for step in (1, 2, 3))


def _minus(value: int) -> str:
    return str(value).replace("-", "−")


PICTURES: dict[str, Callable[[], str]] = {
    "publish-subscribe": publish_subscribe,
    "chatter": chatter,
    "numeric-chatter": numeric_chatter,
    "count": count,
    "around-the-reset": around_the_reset,
}
