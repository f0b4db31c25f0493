"""The pictures: well-formed, escaped, described in words, and not relying on colour."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

from lab2_grader.report.pictures import (
    GraphEdge,
    GraphNode,
    GraphTopic,
    Mark,
    Strip,
    Value,
    first_departure,
    graph_svg,
    sequence_svg,
    strip_svg,
)

SVG = "{http://www.w3.org/2000/svg}"
RIGHT = [*range(128), *range(128)]


def described(picture: str) -> tuple[ET.Element, str]:
    """The picture as XML, and its text for those who do not see it."""
    root = ET.fromstring(picture)
    description = root.find(f"{SVG}desc")
    assert description is not None and description.text
    assert root.get("role") == "img"
    ids = (root.get("aria-labelledby") or "").split()
    assert ids == [element.get("id") for element in root[:2]]
    return root, description.text


def test_the_graph_says_in_words_who_talks_to_whom() -> None:
    picture = graph_svg(
        [GraphNode("t", "/talker"), GraphNode("l", "/listener"), GraphNode("n", "/idle")],
        [GraphTopic("c", "/chatter", "std_msgs/msg/String")],
        [GraphEdge("t", "c", publishes=True), GraphEdge("l", "c", publishes=False)],
        id_prefix="one",
        title="A graph",
    )
    _, text = described(picture)
    assert "Node /talker publishes on /chatter (std_msgs/msg/String)." in text
    assert "Node /listener subscribes to /chatter (std_msgs/msg/String)." in text
    assert "Node /idle has no publisher and no subscription." in text


def test_what_is_missing_is_dashed_marked_and_said() -> None:
    picture = graph_svg(
        [GraphNode("t", "/talker", mark=Mark.OK)],
        [
            GraphTopic("c", "/chatter", mark=Mark.MISSING),
            GraphTopic("x", "/numeric_chater", note="did you mean /numeric_chatter?", mark=Mark.EXTRA),
        ],
        [GraphEdge("t", "c", publishes=True, mark=Mark.MISSING), GraphEdge("t", "x", publishes=True)],
        id_prefix="two",
        title="A graph",
    )
    root, text = described(picture)
    written = " ".join(element.text or "" for element in root.iter(f"{SVG}text"))
    assert "✕ /chatter" in written and "did you mean /numeric_chatter?" in written
    assert "/chatter [missing]" in text and "not asked for did you mean" in text


def test_every_box_lies_inside_the_picture() -> None:
    picture = graph_svg(
        [GraphNode(str(number), f"/a_node_with_a_long_name_{number}") for number in range(9)],
        [GraphTopic("c", "/" + "x" * 300)],
        [GraphEdge(str(number), "c", publishes=number % 2 == 0) for number in range(9)],
        id_prefix="wide",
        title="A graph",
    )
    root, _ = described(picture)
    _, _, width, height = map(float, (root.get("viewBox") or "").split())
    for box in root.iter(f"{SVG}rect"):
        assert float(box.get("x", "-1")) >= 0 and float(box.get("y", "-1")) >= 0
        assert float(box.get("x", "0")) + float(box.get("width", "0")) <= width
        assert float(box.get("y", "0")) + float(box.get("height", "0")) <= height
    assert width < 3000


def test_names_from_a_submission_cannot_break_out() -> None:
    bad = '"><script>alert(1)</script>&'
    graph = graph_svg(
        [GraphNode("n", bad, bad)],
        [GraphTopic("t", bad, bad, bad, Mark.WRONG)],
        [GraphEdge("n", "t", publishes=True, label=bad)],
        id_prefix="bad",
        title=bad,
        desc=bad,
    )
    strip = strip_svg([Strip(bad, (Value(bad, Mark.WRONG),), bad)], id_prefix="bad", title=bad)
    sequence = sequence_svg([1], [1], id_prefix="bad", title=bad, what=bad)
    for picture in (graph, strip, sequence):
        root, _ = described(picture)
        assert "<script" not in picture
        assert {element.tag for element in root.iter()}.isdisjoint({f"{SVG}script"})


def test_an_empty_graph_is_a_picture_too() -> None:
    described(graph_svg([GraphNode("n", "/alone")], [], [], id_prefix="e", title="One node"))
    ET.fromstring(graph_svg([], [], [], id_prefix="e", title="Nothing", desc="Nothing was seen."))


def test_the_first_departure_is_found_and_named() -> None:
    overflow = [*range(128), *range(-128, 0)]
    assert first_departure(overflow, RIGHT) == 128
    assert first_departure(RIGHT, RIGHT) is None
    root, text = described(sequence_svg(overflow, RIGHT, id_prefix="s", title="The count"))
    assert "message 129 is −128, expected 0" in text
    assert "Around it: 125, 126, 127, −128, −127, −126." in text
    assert [element for element in root.iter(f"{SVG}circle") if element.get("class") == "ring"]


def test_a_right_sequence_has_no_ring() -> None:
    root, text = described(sequence_svg(RIGHT, RIGHT, id_prefix="s", title="The count"))
    assert "All are as expected." in text
    assert not list(root.iter(f"{SVG}circle"))


def test_gaps_and_nothing_can_be_drawn() -> None:
    described(sequence_svg([], RIGHT, id_prefix="s", title="Nothing"))
    _, text = described(sequence_svg([0, None, 2], [0, 1, 2], id_prefix="s", title="A gap"))
    assert "All are as expected." in text, "a gap is no departure"
    _, text = described(sequence_svg([0, None, 3], [0, 1, 2], id_prefix="s", title="A gap and a departure"))
    assert "message 3 is 3, expected 2" in text
    assert "Around it: 0, nothing, 3." in text
    described(sequence_svg([5] * 4, [], id_prefix="s", title="Nothing was expected"))


def test_a_long_sequence_stays_small_and_says_so() -> None:
    values = [number % 128 for number in range(50_000)]
    picture = sequence_svg(values, values, id_prefix="s", title="The count")
    assert len(picture) < 60_000
    assert "the first 1,500 of 50,000" in picture


def test_a_strip_names_its_rows_and_wrong_values() -> None:
    strip = Strip("Reset missing", (Value("127"), Value("−128", Mark.WRONG)), "silent", Mark.WRONG)
    root, text = described(strip_svg([strip], id_prefix="r", title="Around the wrap"))
    assert text == "Reset missing [not as asked]: 127, −128 [not as asked]."
    assert len(list(root.iter(f"{SVG}rect"))) == 2


def test_two_pictures_in_one_page_share_no_id() -> None:
    pictures = [sequence_svg([1, 2], [1, 2], id_prefix=name, title="x") for name in ("a", "b")]
    ids = re.findall(r' id="([^"]+)"', "".join(pictures))
    assert len(ids) == len(set(ids)) == 4
