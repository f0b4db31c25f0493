"""Wraps a student's launch file for the real `ros2 launch`: every node it starts follows the ROS clock.

Usage: ros2 launch time_lapse_launch.py launch_file:=PATH
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import SetParameter


def generate_launch_description() -> LaunchDescription:
    """The student's launch description, with `use_sim_time` set for all its nodes."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("launch_file"),
            SetParameter("use_sim_time", True),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(LaunchConfiguration("launch_file"))),
        ]
    )
