"""Starts smartmot-ros: `ros2 launch smartmot_ros smartmot.launch.py odometry:=/odom max_age:=3`.

An argument that is not given leaves the parameter to the node.
"""

import yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

TOPICS = {
    "detections": ("/bevfusion_detections", "boxes, bevfusion_msgs/msg/PredictionArray"),
    "detections_3d": ("/detections", "boxes, vision_msgs/msg/Detection3DArray"),
    "odometry": ("/localization/pose", "nav_msgs/msg/Odometry"),
    "tracked_objects": ("/tracked_objects", "tracks to look at, published"),
    "tracks": ("/smartmot/tracks", "tracks for machines, published"),
}
PARAMETERS = (
    "max_age",
    "detection_th",
    "dataset",
    "map",
    "preset",
    "strategy",
    "rule",
    "velocity_frame",
    "output_frame",
    "vehicle",
    "sensor_pose",
    "detectors",
    "map_frame",
    "base_frame",
    "use_sim_time",
)


def node(context):
    """The node with the arguments that were given."""
    values = context.launch_configurations
    return [
        Node(
            executable="smartmot-ros",
            name="smartmot",
            output="screen",
            parameters=[{name: yaml.safe_load(values[name]) for name in PARAMETERS if values[name]}],
            remappings=[(topic, values[name]) for name, (topic, _) in TOPICS.items()],
        )
    ]


def generate_launch_description():
    """What `ros2 launch` carries out."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=topic, description=f"topic: {text}")
                for name, (topic, text) in TOPICS.items()
            ),
            *(
                DeclareLaunchArgument(name, default_value="", description="parameter: smartmot-ros --help")
                for name in PARAMETERS
            ),
            OpaqueFunction(function=node),
        ]
    )
