"""A node that publishes a greeting on the topic /chatter twice a second."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Talker(Node):
    """Publishes 'Hello World, 0', 'Hello World, 1', … on /chatter."""

    def __init__(self):
        super().__init__('talker')
        self.string_publisher = self.create_publisher(String, 'chatter', 10)
        self.counter = 0

        period_in_seconds = 0.5
        self.timer = self.create_timer(period_in_seconds, self.timer_callback)

    def timer_callback(self):
        message = String()
        message.data = f'Hello World, {self.counter}'
        self.string_publisher.publish(message)
        self.get_logger().info(f'Publishing: {message.data}')
        self.counter += 1


def main(args=None):
    rclpy.init(args=args)
    talker = Talker()
    try:
        rclpy.spin(talker)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        talker.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
