"""A node that prints what it hears on /chatter and on /numeric_chatter."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Int8, String


class NumericListener(Node):
    """Logs each String on /chatter and each Int8 on /numeric_chatter."""

    def __init__(self):
        super().__init__('numeric_listener')
        self.string_subscription = self.create_subscription(
            String, 'chatter', self.string_callback, 10)
        self.number_subscription = self.create_subscription(
            Int8, 'numeric_chatter', self.number_callback, 10)

    def string_callback(self, message):
        self.get_logger().info(f'I heard: {message.data}')

    def number_callback(self, message):
        self.get_logger().info(f'I heard the number: {message.data}')


def main(args=None):
    rclpy.init(args=args)
    numeric_listener = NumericListener()
    try:
        rclpy.spin(numeric_listener)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        numeric_listener.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
