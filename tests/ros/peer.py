"""A process of the node, and a peer of rclpy that sends and receives around it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

NODE = (sys.executable, "-c", "from scenarios.live.node.command import main; main()")
START_S, STOP_S = 90.0, 30.0
"""Times that a loaded machine may take."""


class LiveProcess:
    """`smartmot-ros` as a process of its own.

    Args:
        arguments: of the command.
        folder: for what it prints.
    """

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._output = folder / "output"
        with self._output.open("wb") as output:
            self.process = subprocess.Popen(
                [*NODE, *arguments], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
            )

    def __enter__(self) -> LiveProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    @property
    def output(self) -> str:
        return self._output.read_text()

    def wait_until_ready(self) -> None:
        deadline = time.monotonic() + START_S
        while ": ready" not in self.output:
            assert self.process.poll() is None, self.output
            assert time.monotonic() < deadline, self.output
            time.sleep(0.05)

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal; the status of exit."""
        self.process.send_signal(number)
        return self.process.wait(timeout=STOP_S)


class Peer:
    """A node of rclpy in this process that sends bytes or messages, and keeps what it receives."""

    def __init__(self, name: str = "peer") -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        self._context.init(args=[])
        self.node = rclpy.create_node(name, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Any] = {}
        self.received: dict[str, list[Any]] = {}
        self.received_at: dict[str, list[float]] = {}

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def __enter__(self) -> Peer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def advertise(self, topic: str, type_name: str, *, reliable: bool = True, latched: bool = False) -> None:
        self._publishers[topic] = self.node.create_publisher(
            message_class(type_name), topic, quality(10, reliable=reliable, latched=latched)
        )

    def listen(self, topic: str, type_name: str) -> list[Any]:
        """Messages of a topic, as they come."""
        messages = self.received.setdefault(topic, [])
        times = self.received_at.setdefault(topic, [])

        def keep(message: Any) -> None:
            times.append(time.perf_counter())
            messages.append(message)

        self.node.create_subscription(message_class(type_name), topic, keep, quality(1000))
        return messages

    def send(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)

    def wait_until_matched(self) -> None:
        """Until each topic has its other end."""
        self.spin_until(
            lambda: (
                all(publisher.get_subscription_count() for publisher in self._publishers.values())
                and all(self.node.count_publishers(topic) for topic in self.received)
            ),
            START_S,
        )
        self.spin_for(0.5)  # the other ends have to know of us, too

    def spin_for(self, seconds: float) -> None:
        deadline = time.perf_counter() + seconds
        while (left := deadline - time.perf_counter()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def spin_until(self, condition: Callable[[], Any], timeout_s: float = 20.0) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, "nothing came in time"
            self._executor.spin_once(timeout_sec=0.05)


def message_class(name: str) -> Any:
    package, _, short = name.split("/")
    return getattr(import_module(f"{package}.msg"), short)


def quality(depth: int, *, reliable: bool = True, latched: bool = False) -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def run_node(*arguments: str, python: Sequence[str] = NODE) -> subprocess.CompletedProcess[str]:
    """The node until it ends by itself."""
    return subprocess.run(
        [*python, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=START_S,
        stdin=subprocess.DEVNULL,
    )
