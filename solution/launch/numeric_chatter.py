"""Start the numeric talker and listener together: ros2 launch lab2 numeric_chatter.py."""

from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description():
    return LaunchDescription([
        Node(
            package='lab2',
            executable='numeric_talker',
            name='my_numeric_talker',
        ),
        Node(
            package='lab2',
            executable='numeric_listener',
            name='my_numeric_listener',
        ),
    ])
