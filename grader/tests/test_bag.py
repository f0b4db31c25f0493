"""A recording holds what the evidence holds, read back by the library's own reader."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab2_grader import bag, cli, pipeline
from lab2_grader.errors import UsageError
from lab2_grader.records import Line, Message, SceneName, Tick

highlevel = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed")


def test_messages_come_back_as_they_were(solution_graded: tuple[object, Path], tmp_path: Path) -> None:
    _, observed = pipeline.read(solution_graded[1])
    folders = bag.write(observed, tmp_path / "bag")
    assert [folder.name for folder in folders] == [scene.name.value for scene in observed.scenes]
    scene = observed.scene(SceneName.CONVERSATION)
    assert scene is not None
    with highlevel.AnyReader([tmp_path / "bag" / "conversation"]) as reader:
        found: dict[str, list[object]] = {}
        moments: list[int] = []
        numbers: list[int] = []
        for connection, moment, raw in reader.messages():
            if connection.topic == "/numeric_chatter":
                numbers.append(moment)
            message = reader.deserialize(raw, connection.msgtype)
            moments.append(moment)
            if connection.topic in ("/chatter", "/numeric_chatter"):
                found.setdefault(connection.topic, []).append(message.data)
            elif connection.topic == "/rosout":
                found.setdefault("/rosout", []).append(message.msg)
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
    assert kinds["/numeric_chatter"] == "std_msgs/msg/Int8" and kinds["/clock"] == "rosgraph_msgs/msg/Clock"
    for topic in ("/chatter", "/numeric_chatter"):
        assert found[topic] == [e.data for e in scene.events if isinstance(e, Message) and e.topic == topic]
    assert sorted(map(str, found["/rosout"])) == sorted(e.text for e in scene.events if isinstance(e, Line))
    assert moments == sorted(moments)
    # By the ROS clock: each number between the tick that it answers and the next, however slow the machine was.
    ticks = [event for event in scene.events if isinstance(event, Tick)]
    spoken = [event for event in scene.events if isinstance(event, Message) and event.topic == "/numeric_chatter"]
    for event, moment in zip(spoken, numbers, strict=True):
        gone = sum(tick.at <= event.at for tick in ticks)
        assert moment >= ticks[gone - 1].clock * 1e9 - 1e3
        assert gone == len(ticks) or moment <= ticks[gone].clock * 1e9 + 1e3


def test_a_recording_is_never_overwritten(solution_graded: tuple[object, Path], tmp_path: Path) -> None:
    _, observed = pipeline.read(solution_graded[1])
    bag.write(observed, tmp_path)
    with pytest.raises(UsageError, match="already there"):
        bag.write(observed, tmp_path)


def test_the_command_writes_it(
    solution_graded: tuple[object, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", str(solution_graded[1]), "--bag", str(tmp_path / "bag")]) == 0
    assert "conversation" in capsys.readouterr().out
    assert (tmp_path / "bag" / "conversation" / "metadata.yaml").is_file()
    assert list((tmp_path / "bag" / "conversation").glob("*.mcap"))
