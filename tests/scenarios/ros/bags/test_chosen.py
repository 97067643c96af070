"""Topics of bags by their types: ROS 1 too."""

from pathlib import Path

from scenarios.ros.bags.bag import open_bag
from scenarios.ros.bags.chosen import ChosenTopics, chosen_topics
from scenarios.ros.definitions import OLD_TRANSFORMS, TRANSFORMS, ros1_types
from scenarios.ros.messages import TransformMessage
from tests.scenarios.ros import bags_made


def test_transforms_of_ros1_are_chosen_by_both_of_their_types(tmp_path: Path) -> None:
    t = ros1_types().types
    rows = bags_made.ros1_rows()
    time_ns = rows[0][2]
    pose = t["geometry_msgs/msg/TransformStamped"](
        t["std_msgs/msg/Header"](0, t["builtin_interfaces/msg/Time"](time_ns // 10**9, 0), "map"),
        "base_link",
        t["geometry_msgs/msg/Transform"](
            t["geometry_msgs/msg/Vector3"](3.0, 4.0, 0.0),
            t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        ),
    )
    for topic, type_name in (("/tf", OLD_TRANSFORMS), ("/tf_static", TRANSFORMS)):
        rows.append((topic, type_name, time_ns, t[type_name]([pose])))
    with open_bag(bags_made.write_ros1(tmp_path / "a.bag", rows)) as bag:
        chosen = chosen_topics(bag, None, None)
        assert chosen == ChosenTopics(("/merged",), None, ("/tf", "/tf_static"))
        moved = [
            m.position_m.tolist() for _, m in bag.messages(*chosen.names) if isinstance(m, TransformMessage)
        ]
    assert moved == [[[3.0, 4.0, 0.0]]] * 2
