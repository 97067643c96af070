"""Definitions of ROS messages that no library ships, and the stores of types they are added to.

Sources: bevfusion_msgs of the PREMOVE document; vision_msgs 4.x (ros-perception/vision_msgs, branch ros2);
t4ac_msgs of the SmartMOT authors (RobeSafe-UAH/t4ac_msgs_ros), which their pipeline takes in ROS 1. Standard
messages come from rosbags.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarios.ros.libraries import require_libraries

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

PREDICTION_ARRAY = "bevfusion_msgs/msg/PredictionArray"
DETECTION_3D_ARRAY = "vision_msgs/msg/Detection3DArray"
BEV_DETECTIONS = "t4ac_msgs/msg/BEV_detections_list"
MONITORED_LANES = "t4ac_msgs/msg/MonitorizedLanes"
ODOMETRY = "nav_msgs/msg/Odometry"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"
"""Of ROS 1."""

ROS2_DEFINITIONS = {
    "bevfusion_msgs/msg/Prediction": """
int32 id
string class_name
geometry_msgs/Point position
geometry_msgs/Vector3 size
geometry_msgs/Vector3 velocity
float32 z_rotation
float32 score
""",
    PREDICTION_ARRAY: """
std_msgs/Header header
bevfusion_msgs/Prediction[] predictions
""",
    "vision_msgs/msg/ObjectHypothesis": """
string class_id
float64 score
""",
    "vision_msgs/msg/ObjectHypothesisWithPose": """
vision_msgs/ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
""",
    "vision_msgs/msg/BoundingBox3D": """
geometry_msgs/Pose center
geometry_msgs/Vector3 size
""",
    "vision_msgs/msg/Detection3D": """
std_msgs/Header header
vision_msgs/ObjectHypothesisWithPose[] results
vision_msgs/BoundingBox3D bbox
string id
""",
    DETECTION_3D_ARRAY: """
std_msgs/Header header
vision_msgs/Detection3D[] detections
""",
}
"""By name, in the syntax of .msg files."""

ROS1_DEFINITIONS = {
    TRANSFORMS: "geometry_msgs/TransformStamped[] transforms",
    OLD_TRANSFORMS: "geometry_msgs/TransformStamped[] transforms",
    "t4ac_msgs/msg/BEV_detection": """
string type
float64 score
uint16 object_id
float64 x
float64 y
float64 vel_lin
float64 vel_ang
float64[] tl_br
float64[] x_corners
float64[] y_corners
float64 l
float64 w
float64 o
bool safety_zone
""",
    BEV_DETECTIONS: """
std_msgs/Header header
float64 front
float64 back
float64 left
float64 right
t4ac_msgs/BEV_detection[] bev_detections_list
""",
    "t4ac_msgs/msg/BEV_tracker": """
string type
uint16 object_id
float64 x
float64 y
float64 w
float64 l
float64 o
""",
    "t4ac_msgs/msg/BEV_trackers_list": """
std_msgs/Header header
t4ac_msgs/BEV_tracker[] bev_trackers_list
""",
    "t4ac_msgs/msg/Node": """
float64 x
float64 y
float64 z
""",
    "t4ac_msgs/msg/Way": """
t4ac_msgs/Node[] way
""",
    "t4ac_msgs/msg/Lane": """
t4ac_msgs/Way left
t4ac_msgs/Way right
string role
""",
    MONITORED_LANES: """
std_msgs/Header header
t4ac_msgs/Lane[] lanes
""",
}
"""By name, in the syntax of .msg files."""


def ros2_types() -> Typestore:
    """A new store of ROS 2's standard messages and those of `ROS2_DEFINITIONS`.

    Raises:
        DatasetError: the extra `ros` is not installed.
    """
    require_libraries()
    from rosbags.typesys import Stores, get_typestore

    return _extended(get_typestore(Stores.ROS2_JAZZY), ROS2_DEFINITIONS)


def ros1_types() -> Typestore:
    """A new store of ROS 1's standard messages and those of `ROS1_DEFINITIONS`; see `ros2_types`."""
    require_libraries()
    from rosbags.typesys import Stores, get_typestore

    return _extended(get_typestore(Stores.ROS1_NOETIC), ROS1_DEFINITIONS)


def _extended(store: Typestore, definitions: dict[str, str]) -> Typestore:
    from rosbags.typesys import get_types_from_msg

    for name, text in definitions.items():
        store.register(get_types_from_msg(text, name))
    return store
